"""The projectiles are heavier or lighter than stated, all by the same factor."""

from dataclasses import replace

from labsim.effects import LogNormal, Parameter, all_pushed

title = "The projectiles' mass is not the stated mass"
says = ("The projectiles are lighter than stated", "The projectiles are heavier than stated")
kind = "projectile"
parameters = (
    Parameter(
        "factor",
        "1",
        null=1.0,
        limits=(0.5, 2.0),
        prior=LogNormal(1.0, 0.08),
        step=0.05,
        symbol="m/m0",
        text="True over stated. Balances are better, but masses computed from a diameter and a catalogue density are wrong "
        "by three times the error of the diameter.",
    ),
)
leaves = "Depth and stopping time of all drops by nearly the same factor, which p_m takes up; two masses at one radius help."
remedy = (
    "weigh the projectiles again: these drops ask for a mass_mg that is {value:.3f} times what "
    "drop.toml states"
)
references = ("Güttler et al. (2009): D grows with m v/A",)
expect = {"penetration_depth": 1, "stopping_time": 1}


def applies(campaign):
    return "every projectile is pushed" if all_pushed(campaign) else ""


def change_setting(setting, values, place):
    projectile = setting.projectile
    return setting.replace(projectile=replace(projectile, mass=projectile.mass * values["factor"]))

"""The shear strength is not √(Σ|T|): Y = factor √(Σ|T|). The factor is the whole one, not relative to the nominal."""

from labsim.effects import LogNormal, Parameter

title = "The shear strength is a multiple of √(Σ|T|)"
says = ("The shear strength is less than √(Σ|T|)", "The shear strength is more than √(Σ|T|)")
kind = "material"
needs = ("shear_factor",)


def parameters(campaign):
    nominal = campaign.material.shear_factor
    middle = nominal if nominal > 0.0 else 1.0
    return (
        Parameter(
            "factor",
            "1",
            null=nominal,
            limits=(min(0.1 * middle, nominal), 6.0 * middle),
            prior=LogNormal(middle, 0.5),
            step=-0.25 * middle if nominal > 0.0 else 0.25,
            symbol="Y/√(Σ|T|)",
            text="The rule is a guess (a geometric mean); particle simulations found shear strengths that differ from it by "
            "up to a few times either way, and the yield conventions in use differ by √3.",
        ),
    )


leaves = (
    "Depth and stopping time change like those of another p_m, but the compacted volume moves the opposite way: less shear "
    "strength lets the dust flow aside instead of being compacted."
)
references = (
    "Sirono (2004): Y = √(Σ|T|)",
    "Seizinger, Speith & Kley (2013): shear strength differs significantly from earlier models",
)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    return setting.replace(material=setting.material.replace(shear_factor=values["factor"]))

"""The filling factor changes linearly with depth: φ0 + gradient depth."""

from labsim.effects import Normal, Parameter, deepest_dust, list_impacts
from labsim.sph.setting import LEAST_GRADED, LOOSEST

title = "The filling factor changes with depth"
says = ("The dust is looser with depth", "The dust is denser with depth")
kind = "sample"
needs = ("filling_gradient", "phi_1")


def parameters(campaign):
    phi, material = campaign.sample.filling_factor, campaign.material
    depth = deepest_dust(campaign)
    steepest = 0.6 * (material.phi_2 - phi) / depth
    largest = max(radius for radius, _, _ in list_impacts(campaign))
    # falling, φ0 stays as it is from near φ1 on; that must lie below what the projectile acts on
    loosening = max(0.9 * (phi - material.phi_1 - LOOSEST) / (LEAST_GRADED * largest), 0.0)
    return (
        Parameter(
            "gradient",
            "1/m",
            null=0.0,
            limits=(-loosening, steepest),
            prior=Normal(0.0, 4.0),
            step=min(2.0, 0.5 * steepest),
            symbol="dφ/dz",
            text="Deposits are even to a few percent per cm (0.5 per m); settling, shaking or transport have left twenty "
            "percent in strength per mm (4 per m).",
        ),
    )


leaves = (
    "The deeper the drop, the larger the change: fast and heavy drops deviate from what slow ones say of p_m, in the "
    "opposite order to a crust. Undisturbed dust in the CT shows it."
)
references = ("Blum & Schräpler (2004): layer-wise growth of random ballistic deposits",)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    return setting.replace(filling_gradient=values["gradient"])

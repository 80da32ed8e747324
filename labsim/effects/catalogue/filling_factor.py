"""The sample is denser or looser than stated: φ0 everywhere."""

from labsim.effects import Normal, Parameter

title = "The sample is denser or looser than stated"
says = ("The sample is looser than stated", "The sample is denser than stated")
kind = "sample"
needs = ("phi_1",)


def parameters(campaign):
    stated, material = campaign.sample, campaign.material
    room_below = stated.filling_factor - material.phi_1
    room_above = material.phi_2 - stated.filling_factor
    width = max(0.01, 2.0 * stated.filling_factor_sigma)
    return (
        Parameter(
            "phi_0",
            "1",
            null=stated.filling_factor,
            limits=(stated.filling_factor - 0.85 * room_below, stated.filling_factor + 0.6 * room_above),
            prior=Normal(stated.filling_factor, width),
            step=min(0.5 * width, 0.5 * room_above),
            symbol="φ0",
            text="Random ballistic deposits come out within about 0.01 of 0.15; the stated uncertainty is what has just "
            "failed, so at least that much.",
        ),
    )


leaves = (
    "Strength and inertia of all dust change together (at 0.15 one percent in φ is seven percent in Σ), which p_m takes "
    "up almost entirely; undisturbed dust in the CT shows it directly."
)
remedy = "weigh the sample again: these data ask for filling_factor = {value:.4f} under [sample]"
references = ("Blum & Schräpler (2004): filling factor of random ballistic deposits",)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    return setting.replace(filling_factor=values["phi_0"])

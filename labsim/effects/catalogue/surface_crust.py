"""The top is denser or fluffier than the bulk: φ0 + excess exp(-depth/length)."""

from labsim.effects import LogNormal, Normal, Parameter

title = "The top of the sample is denser or fluffier than the bulk"
says = ("The top of the sample is fluffier than the bulk", "The top of the sample is denser than the bulk")
kind = "sample"
needs = ("crust_excess", "phi_1")


def parameters(campaign):
    phi, material = campaign.sample.filling_factor, campaign.material
    smallest = min(drop.projectile.tip_radius for drop in campaign.drops)
    return (
        Parameter(
            "excess",
            "1",
            null=0.0,
            limits=(-0.85 * (phi - material.phi_1), 0.6 * (material.phi_2 - phi)),
            prior=Normal(0.0, 0.05),
            step=min(0.02, 0.3 * (material.phi_2 - phi)),
            symbol="Δφ",
            text="Cutting, pressing and settling make crusts of up to 0.25, the last grains to arrive may lie at 0.10; "
            "looser than φ1 has no strength.",
        ),
        Parameter(
            "length",
            "m",
            null=0.6 * smallest,
            limits=(0.04 * smallest, 10.0 * smallest),
            prior=LogNormal(0.6 * smallest, 0.7),
            step=0.2 * smallest,
            shape=True,
            symbol="ℓ",
            text="Decay with depth: of the order of the smallest tip, since much thinner ones are not felt and much thicker "
            "ones are another filling factor.",
        ),
    )


leaves = (
    "An offset of depth that is about the same in mm for all drops, so that slow drops are affected most; small tips more "
    "than large ones. The CT shows it beside the bead if its voxels are finer than the crust."
)
remedy = "take the crust off, or keep it in the model: labsim simulate --model model.toml"
without = "where the top of the sample is taken off"
references = (
    "Weidling, Güttler, Blum & Brauer (2009): compaction of surfaces by handling and repeated impact",
)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    if values["excess"] == 0.0:
        return setting
    return setting.replace(crust_excess=values["excess"], crust_length=values["length"])

"""Coulomb friction between the tip and the dust: tangential traction up to μ times the normal one, against the sliding."""

from labsim.effects import HalfNormal, Normal, Parameter

title = "Friction between tip and dust"
kind = "contact"


def parameters(campaign):
    nominal = campaign.material.contact_friction
    return (
        Parameter(
            "mu",
            "1",
            null=nominal,
            limits=(0.0, max(1.5, 2.0 * nominal)),
            prior=Normal(nominal, 0.3) if nominal > 0.0 else HalfNormal(0.3),
            step=0.15,
            symbol="μ",
            text="Powders on glass and steel slide at 0.1 to 0.6; above 1 the dust shears instead of sliding.",
        ),
    )


leaves = (
    "Shallower drops, like a larger p_m, but less dust pushed aside and more carried down in front of the tip; it matters "
    "most while the tip is only half immersed."
)
references = ("Katsuragi & Durian (2007): friction in the drag on a penetrating sphere",)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    return setting.replace(material=setting.material.replace(contact_friction=values["mu"]))

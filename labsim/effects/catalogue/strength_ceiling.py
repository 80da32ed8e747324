"""The strength diverges at another filling factor: φ2 in Σ = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10) is not the nominal one."""

from labsim.effects import Normal, Parameter

title = "The filling factor where the strength diverges differs"
says = (
    "The strength diverges at a smaller filling factor",
    "The strength diverges at a larger filling factor",
)
kind = "material"
needs = ("phi_2",)


def parameters(campaign):
    phi_2, loosest = campaign.material.phi_2, campaign.sample.filling_factor
    return (
        Parameter(
            "phi_2",
            "1",
            null=phi_2,
            limits=(min(max(loosest + 0.1, 0.25), 0.5 * (loosest + phi_2)), max(0.74, phi_2 + 0.1)),
            prior=Normal(phi_2, 0.08),
            step=0.05 if phi_2 + 0.05 <= max(0.74, phi_2 + 0.1) else -0.05,
            symbol="φ2",
            text="Between 0.33 (compression along one direction) and 0.74 (close packing), 0.45 to 0.65 from all sides; "
            "0.08 covers that.",
        ),
    )


leaves = (
    "A smaller φ2 is a stronger dust that hardens sooner: depths trade against p_m almost entirely, fast drops flatten, "
    "and the densest dust below the tip stays looser. Only the densest part of the CT tells it from p_m."
)
references = (
    "Güttler et al. (2009), eq. 6",
    "Meisner et al. (2012): saturation of compression in one direction at φ = 0.31",
)
expect = {"penetration_depth": 1, "stopping_time": 1}


def change_setting(setting, values, place):
    return setting.replace(material=setting.material.replace(phi_2=values["phi_2"]))

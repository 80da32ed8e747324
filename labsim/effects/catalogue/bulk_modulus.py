"""The dust is stiffer or softer elastically: K(φ0') = K0 (φ0'/0.15)^γ with another K0, and μ = shear_to_bulk K with it."""

from labsim.effects import LogNormal, Parameter, list_impacts

title = "The bulk modulus differs"
says = ("The dust is softer than its bulk modulus says", "The dust is stiffer than its bulk modulus says")
kind = "material"
needs = ("bulk_modulus", "shear_to_bulk")


def parameters(campaign):
    nominal, dust = campaign.material, campaign.sample
    # the tip must stay slower than sound in the dust
    fastest = max(speed for _, _, speed in list_impacts(campaign))
    density = dust.monomer_density * dust.filling_factor
    least = 2.0 * density * fastest**2 / (1.0 + 4.0 / 3.0 * nominal.shear_to_bulk)
    low = min(max(nominal.bulk_modulus / 50.0, least, 500.0), 0.9 * nominal.bulk_modulus)
    return (
        Parameter(
            "K0",
            "Pa",
            null=nominal.bulk_modulus,
            limits=(low, 20.0 * nominal.bulk_modulus),
            prior=LogNormal(nominal.bulk_modulus, 1.0),
            step=max(-0.5 * nominal.bulk_modulus, low - nominal.bulk_modulus),
            symbol="K0",
            text="K at φ = 0.15. The same dust has been given 300 kPa (from a sound speed) and 4.5 kPa (to make it "
            "bounce): a factor of e either way is what is known.",
        ),
    )


leaves = (
    "Rebound and ringing after the stop, and a wide halo of slightly compacted dust where K0 is small; the depth grows by a "
    "few percent for a ten times smaller K0, almost like a smaller p_m."
)
references = (
    "Güttler, Krause, Geretshauser, Speith & Blum (2009b)",
    "Geretshauser, Speith, Güttler, Krause & Blum (2010): K calibrated by the bouncing of dust",
)
expect = {"penetration_depth": -1, "stopping_time": -1}


def change_setting(setting, values, place):
    return setting.replace(material=setting.material.replace(bulk_modulus=values["K0"]))

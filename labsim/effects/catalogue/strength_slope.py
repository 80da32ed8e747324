"""The compressive strength rises with another slope: Δ in Σ = p_m ((φ - φ1)/(φ2 - φ))^(Δ ln 10) is not the nominal one."""

from labsim.effects import Normal, Parameter

title = "The slope of the strength differs"
says = (
    "The strength grows slower with the filling factor than stated",
    "The strength grows faster with the filling factor than stated",
)
kind = "material"
needs = ("delta",)


def parameters(campaign):
    delta = campaign.material.delta
    return (
        Parameter(
            "delta",
            "1",
            null=delta,
            limits=(min(0.1, delta / 2), max(1.6, 2 * delta)),
            prior=Normal(delta, 0.2),
            step=0.1,
            symbol="Δ",
            text="Slope of log Σ. One and the same dust gave 0.33 compressed along one direction and 0.58 from all sides; "
            "a drop is neither, so the width is their difference.",
        ),
    )


leaves = (
    "Dust of φ below (φ1 + φ2)/2 is softer for a larger Δ, denser dust harder: depths trade against p_m almost entirely, "
    "but the compacted volume above φ = 0.2 grows and its densest part with it. The CT decides, the tracks hardly do."
)
references = ("Güttler et al. (2009), eq. 6 and its two sets of parameters",)
expect = {"penetration_depth": 1, "stopping_time": 1}


def change_setting(setting, values, place):
    return setting.replace(material=setting.material.replace(delta=values["delta"]))

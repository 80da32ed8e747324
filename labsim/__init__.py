"""labsim: laboratory drops into porous dust, linked to an SPH simulation of the same drops."""

__version__ = "0.1.0"

"""One file per effect. ``labsim.effects.loading`` lists this folder; there is nothing to register."""

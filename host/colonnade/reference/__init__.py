"""The reference renderer: the float scene without any of the hardware's rounding."""

"""The backends of the device: the bit-exact model, and the RTL under Verilator."""

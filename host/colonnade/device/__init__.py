"""The device: the bit-exact model, and the RTL under Verilator."""

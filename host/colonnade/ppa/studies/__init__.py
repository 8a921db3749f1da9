"""Studies on area: the FPGA, the guard on gate counts, the gain of the tree."""

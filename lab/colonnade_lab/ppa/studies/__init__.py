"""Area studies: the FPGA, and the regression check of gate counts."""

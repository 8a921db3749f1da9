"""Area studies: the FPGA, the regression check of gate counts, and cost and gain of the BVH."""

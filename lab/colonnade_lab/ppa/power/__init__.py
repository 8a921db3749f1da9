"""Power: port recordings of the RTL, their replay on the gate netlist, and the energy per transition."""

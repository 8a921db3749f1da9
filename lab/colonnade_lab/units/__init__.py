"""Units of a design at their ports: proofs, equivalence with another version, mutants.

`checks`, `aiger` and `engines` lead from firtool's SystemVerilog over Yosys to abc. They and `proof` need Yosys and the
standard library only, so that the hardware's specs run without the host's packages.
"""

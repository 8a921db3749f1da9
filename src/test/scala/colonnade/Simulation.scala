package colonnade

import chiseltest.VerilatorBackendAnnotation
import chiseltest.simulator.VerilatorCFlags

/** Simulation settings of specs. */
object Simulation {

  /** For all C++ of Verilator: g++ 12.2 miscompiles population counts when it vectorises them. */
  val safeFlags: Seq[String] = Seq("-fno-tree-slp-vectorize")

  /** Verilator, for units that are slow in the interpreter. */
  val verilator = Seq(VerilatorBackendAnnotation, VerilatorCFlags(safeFlags))
}

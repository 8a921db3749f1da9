package colonnade

import chiseltest.VerilatorBackendAnnotation
import chiseltest.simulator.VerilatorCFlags

/** How specs simulate a unit. */
object Simulation {

  /** In each compilation of C++ that Verilator wrote: g++ 12.2 vectorises population counts wrongly. */
  val safeFlags: Seq[String] = Seq("-fno-tree-slp-vectorize")

  /** With Verilator, for units that are slow to interpret. */
  val verilator = Seq(VerilatorBackendAnnotation, VerilatorCFlags(safeFlags))
}

package colonnade

import chiseltest.VerilatorBackendAnnotation
import chiseltest.simulator.{VerilatorCFlags, VerilatorFlags}

/** Simulation settings of specs. */
object Simulation {

  /** For all C++ of Verilator: g++ 12.2 miscompiles population counts when it vectorises them. */
  val safeFlags: Seq[String] = Seq("-fno-tree-slp-vectorize")

  /** Verilator, for units that are slow in the interpreter. Its headers take longer to compile than the unit: so all is one
    * file. A limit of 0 would split off every constant.
    */
  val verilator =
    Seq(
      VerilatorBackendAnnotation,
      VerilatorFlags(Seq("--output-split", Int.MaxValue.toString)),
      VerilatorCFlags(safeFlags)
    )
}

package chiseltest.formal.backends.bounded

import chisel3.Module
import chiseltest.formal.backends.smt.SolverContext
import firrtl2.backends.experimental.smt._
import treadle2.vcd.VCD

/** Checks a module by z3 in the cycles that follow one cycle of reset. Lies in chiseltest's package, whose parts are
  * private to it. Its own `verify` does not get through larger modules, passes where assumptions contradict one
  * another, and knows no covers.
  */
object BoundedProof {

  /** Nothing where the module's assertions hold in `cycles` cycles, its assumptions can be kept in all of them and each
    * of its covers happens; otherwise what is wrong.
    */
  def objection(module: () => Module, cycles: Int, directory: String): Option[String] = {
    val proof = new BoundedProof(ProofSystem(module, directory))
    proof.violation(cycles).orElse(proof.emptiness(cycles)).map(objection => s"${proof.name}: $objection")
  }
}

private final class BoundedProof(proof: ProofSystem) {
  val name: String = proof.system.name

  /** The earliest violation. */
  def violation(cycles: Int): Option[String] =
    if (proof.assertions.isEmpty) Some("nothing is asserted")
    else LazyList.range(1, cycles + 1).flatMap(violationIn).headOption

  private def violationIn(cycle: Int): Option[String] = {
    val cycles = new Unrolling(proof.system, cycle)
    cycles.search(any(proof.assertions.map(cycles.bit(_, cycle))), holdingUntil(cycles, cycle - 1)) { z3 =>
      val violated = proof.assertions.filter(name => z3.getValue(cycles.bit(name, cycle)).contains(BigInt(1)))
      val trace    = writeTrace(cycle, z3, cycles).relativeTo(os.pwd)
      s"violated in cycle $cycle after the reset: ${violated.map(proof.describe).mkString(", ")}; see $trace"
    }
  }

  /** Why the proof says nothing, if it does not. */
  def emptiness(count: Int): Option[String] = {
    val cycles                                 = new Unrolling(proof.system, count)
    val holding                                = holdingUntil(cycles, count)
    def isPossible(condition: BVExpr): Boolean = cycles.search(condition, holding)(_ => ()).nonEmpty

    if (!isPossible(BVLiteral(1, 1))) Some(s"the assumptions can't be kept for $count cycles")
    else
      proof.covers
        .find(cover => !isPossible(any((1 to count).map(cycles.bit(cover, _)))))
        .map(cover => s"can't happen within $count cycles: ${proof.describe(cover)}")
  }

  /** The assertions hold until the last of these cycles, which is known by then: so z3 need not find it out again. */
  private def holdingUntil(cycles: Unrolling, last: Int): Seq[BVExpr] =
    for (cycle <- 1 to last; name <- proof.assertions) yield BVNot(cycles.bit(name, cycle))

  private def any(bits: Seq[BVExpr]): BVExpr = bits.reduce(BVOr(_, _))

  /** All values up to the violation, as a waveform: a time step a cycle, from the reset on. */
  private def writeTrace(cycle: Int, z3: SolverContext, cycles: Unrolling): os.Path = {
    val trace = VCD(name)
    for (symbol <- cycles.symbols) trace.addWire(symbol.name, symbol.width)
    for (time <- 0 to cycle) {
      for (symbol <- cycles.symbols; value <- z3.getValue(cycles.at(symbol, time)))
        trace.wireChanged(symbol.name, value)
      trace.incrementTime()
    }
    val file = proof.directory / s"$name.vcd"
    trace.write(file.toString)
    file
  }
}

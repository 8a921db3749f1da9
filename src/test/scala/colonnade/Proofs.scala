package colonnade

import chisel3.Module
import chiseltest.HasTestName
import chiseltest.formal.backends.bounded.BoundedProof
import org.scalatest.TestSuite

import scala.util.Try

/** Bounded model checks; a spec is cancelled where z3 is missing. */
trait Proofs { this: TestSuite with HasTestName =>

  /** Proves the module's assertions for the first `cycles` cycles after a reset, for all inputs that meet its assumptions.
    * Also fails if the proof is vacuous: if assumptions contradict each other, or a `cover` cannot happen.
    */
  def prove(cycles: Int)(module: => Module): Unit = {
    if (!Proofs.hasZ3) cancel("z3 is not installed")
    BoundedProof.objection(() => module, cycles, s"test_run_dir/$getTestName").foreach(fail(_))
  }
}

object Proofs {
  private lazy val hasZ3: Boolean =
    Try(new ProcessBuilder("z3", "--version").redirectErrorStream(true).start().waitFor() == 0).getOrElse(false)
}

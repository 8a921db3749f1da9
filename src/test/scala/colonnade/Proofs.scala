package colonnade

import chisel3.Module
import chiseltest.formal._
import chiseltest.{ChiselScalatestTester, HasTestName}
import org.scalatest.TestSuite

import scala.util.Try

/** Bounded model checks; a spec is cancelled where z3 is missing. */
trait Proofs extends Formal { this: TestSuite with ChiselScalatestTester with HasTestName =>

  /** Holds the module's assertions for all inputs of the first `cycles` cycles after a reset. */
  def prove(cycles: Int)(module: => Module): Unit = {
    assume(Proofs.hasZ3, "z3 is not installed")
    verify(module, Seq(BoundedCheck(cycles), Z3EngineAnnotation))
  }
}

object Proofs {
  private lazy val hasZ3: Boolean =
    Try(new ProcessBuilder("z3", "--version").redirectErrorStream(true).start().waitFor() == 0).getOrElse(false)
}

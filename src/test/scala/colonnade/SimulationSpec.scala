package colonnade

import chisel3._
import chiseltest._
import chiseltest.simulator.VerilatorFlags
import firrtl2.AnnotationSeq
import firrtl2.options.TargetDirAnnotation
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

/** What specs simulate is what they elaborate, whatever was simulated in their folder before. */
class SimulationSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "A simulator"

  private val folder = os.pwd / "test_run_dir" / "SimulationSpec"

  private def sum(step: Int, flags: Seq[String] = Nil): BigInt = {
    val options: AnnotationSeq = TargetDirAnnotation("test_run_dir/SimulationSpec") +: VerilatorFlags(flags) +:
      Simulation.verilator.filterNot(_.isInstanceOf[VerilatorFlags])
    var sum = BigInt(0)
    test(new SimulationSpecSum(step)).withAnnotations(options) { dut =>
      dut.in.poke(40)
      sum = dut.out.peek().litValue
    }
    sum
  }

  /** When the simulator of the folder was built. */
  private def built: Long = os.mtime(folder / "verilated" / "VSimulationSpecSum")

  it should "be kept for the same circuit, and built again for another one, other flags, and after a build that broke off" in {
    os.remove.all(folder)
    sum(2) shouldBe 42
    val first = built
    sum(2) shouldBe 42
    built shouldBe first
    os.list(folder / "verilated").map(_.last).filter(_.matches("V.*_\\d+")) shouldBe empty

    sum(3) shouldBe 43
    built should not be first
    val second = built
    sum(3, Seq("--x-assign", "0")) shouldBe 43
    built should not be second

    // A build that wrote its simulator, and not its key
    val other = os.read.bytes(folder / "verilated" / "VSimulationSpecSum")
    sum(2) shouldBe 42
    intercept[Exception](sum(3, Seq("--no-such-flag")))
    os.write.over(folder / "verilated" / "VSimulationSpecSum", other, createFolders = true)
    sum(2) shouldBe 42
  }
}

private class SimulationSpecSum(step: Int) extends Module {
  val in  = IO(Input(UInt(8.W)))
  val out = IO(Output(UInt(8.W)))
  out := in + step.U
}

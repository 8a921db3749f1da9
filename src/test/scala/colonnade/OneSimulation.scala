package colonnade

import chisel3._
import chisel3.reflect.DataMirror
import chiseltest._
import firrtl2.options.TargetDirAnnotation
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec

/** Tests of a module in one simulation, which takes longer to build than to run. */
trait OneSimulation extends ChiselScalatestTester { this: AnyFlatSpec =>

  /** Each test begins after a reset, with inputs of 0. */
  protected def inOneSimulation[M <: Module](module: => M, tags: Tag*)(tests: (String, M => Unit)*): Unit = {
    def run() =
      test(module).withAnnotations(folder(tests.head._1) +: Simulation.verilator) { dut =>
        for ((name, run) <- tests) withClue(s"$name: ") {
          DataMirror.modulePorts(dut).map(_._2).filterNot(Seq(dut.clock, dut.reset).contains).foreach(clear)
          dut.reset.asBool.poke(true)
          dut.clock.step()
          dut.reset.asBool.poke(false)
          run(dut)
        }
      }
    val specification = it should tests.map(_._1).mkString("; ")
    tags.headOption.fold(specification.in(run()))(tag => specification.taggedAs(tag).in(run()))
  }

  /** The names of all tests are too long for one. */
  private def folder(name: String) = TargetDirAnnotation(s"test_run_dir/${getClass.getSimpleName}_${name.hashCode}")

  private def clear(port: Data): Unit = port match {
    case parts: Aggregate                                                       => parts.getElements.foreach(clear)
    case leaf: Element if DataMirror.directionOf(leaf) == ActualDirection.Input =>
      leaf match {
        case bool: Bool   => bool.poke(false)
        case number: UInt => number.poke(0)
        case number: SInt => number.poke(0)
        case other        => throw new IllegalArgumentException(s"an input of type $other")
      }
    case _ =>
  }
}

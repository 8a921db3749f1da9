package colonnade

import chisel3._
import chisel3.reflect.DataMirror
import chiseltest._
import colonnade.config.ColonnadeConfig
import firrtl2.options.TargetDirAnnotation
import org.scalacheck.{Prop, Test}
import org.scalacheck.rng.Seed
import org.scalatest.{Assertions, Reporter, Tag}
import org.scalatest.events.{Event, SuiteAborted, SuiteCompleted, SuiteStarting, TestFailed}
import org.scalatest.exceptions.TestFailedException
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatestplus.scalacheck.Checkers

import java.nio.file.{Files, Path, Paths}
import java.util.Comparator
import scala.jdk.CollectionConverters._
import scala.util.Using

/** Marks a spec that `make verify` runs, and `sbt test` only with COLONNADE_MATRIX=1. */
object Matrix extends Tag("colonnade.Matrix")

/** Marks a spec that `sbt test` always runs. */
object Always extends Tag("colonnade.Always") {

  def unless(isMiddle: Boolean): Tag = if (isMiddle) Matrix else this

  /** For a spec that runs in many formats: the narrowest, the widest and that of the presets always run. */
  def ifExtreme(config: ColonnadeConfig): Tag = {
    val extremes = Seq(TestConfigs.tiny, TestConfigs.withPrecision(16, 16, 16), TestConfigs.withPrecision(64, 64, 64))
    if (extremes.exists(_.copy(physicalAttributeMemory = config.physicalAttributeMemory) == config)) Always else Matrix
  }
}

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

/** Prints the CPU seconds of each suite of a run one after the other, with those of programs that it ran: for
  * `tools/mutations --seconds`. Needs Linux.
  */
class SuiteSeconds extends Reporter {
  private var start = 0.0

  def apply(event: Event): Unit = event match {
    case _: SuiteStarting      => start = SuiteSeconds.used()
    case suite: SuiteCompleted => println(f"SUITE ${suite.suiteId} ${SuiteSeconds.used() - start}%.1f")
    case _                     => ()
  }
}

object SuiteSeconds {

  /** CPU seconds of this process and of its children that have ended; the kernel counts hundredths. */
  def used(): Double = {
    val fields = Files.readString(Paths.get("/proc/self/stat")).split(raw"\) ").last.split(' ')
    fields.slice(11, 15).map(_.toDouble).sum / 100
  }
}

/** Ends the JVM of the tests at the first one that fails, and names it: for `tools/mutations`. */
class FirstFailure extends Reporter {
  def apply(event: Event): Unit = event match {
    case test: TestFailed    => end(test.testName, test.message)
    case suite: SuiteAborted => end("before the tests", suite.message)
    case _                   => ()
  }

  private def end(test: String, message: String): Unit = {
    println(s"FIRST FAILURE: $test: ${message.linesIterator.nextOption().getOrElse("")}")
    Console.flush()
    Runtime.getRuntime.halt(FirstFailure.status)
  }
}

object FirstFailure {
  val status = 3
}

/** Properties of random values, with a new seed in each run. A failure names its seed; the environment variable
  * `PROPERTY_SEED` repeats it.
  */
trait Properties extends Checkers { this: Assertions =>

  protected def holds(cases: Int)(property: Prop): Unit = {
    val seed = sys.env.get("PROPERTY_SEED").fold(Seed.random())(Seed.fromBase64(_).get)
    // The failure is converted to text: its values could not be serialised by the forked process
    try check(property, Test.Parameters.default.withMinSuccessfulTests(cases).withInitialSeed(seed))
    catch {
      case failure: TestFailedException => fail(s"with PROPERTY_SEED=${seed.toBase64}: ${failure.getMessage}")
    }
  }
}

/** Temporary folders of specs that write files. */
object Scratch {

  /** Runs with an empty folder, which is removed afterwards. */
  def apply[T](body: Path => T): T = {
    val scratch = Files.createTempDirectory("colonnade")
    try body(scratch)
    finally Using.resource(Files.walk(scratch))(_.sorted(Comparator.reverseOrder[Path]()).forEach(Files.delete(_)))
  }

  /** The names in a folder, in order. */
  def names(folder: Path): Seq[String] =
    Using.resource(Files.list(folder))(_.iterator.asScala.map(_.getFileName.toString).toSeq.sorted)
}

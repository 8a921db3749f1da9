package colonnade

import chiseltest.VerilatorBackendAnnotation
import chiseltest.internal.CachingAnnotation
import chiseltest.simulator._
import firrtl2.CircuitState
import firrtl2.annotations.JsonProtocol
import firrtl2.options.TargetDirAnnotation

import java.nio.charset.StandardCharsets.UTF_8
import java.security.MessageDigest
import scala.sys.process.{Process, ProcessLogger}
import scala.util.Try

/** Simulation settings of specs. */
object Simulation {

  /** For all C++ of Verilator: g++ 12.2 miscompiles population counts when it vectorises them. */
  val safeFlags: Seq[String] = Seq("-fno-tree-slp-vectorize")

  /** Verilator, for units that are slow in the interpreter. Its headers take longer to compile than the unit: so all is
    * one file. A limit of 0 would split off every constant.
    */
  val verilator =
    Seq(
      KeptSimulators.annotation,
      VerilatorFlags(Seq("--output-split", Int.MaxValue.toString)),
      VerilatorCFlags(safeFlags)
    )
}

/** Verilator's simulators, each kept in its test's folder until the circuit, the flags or the tools are others.
  * chiseltest's own cache, beneath, knows neither compiler nor environment, and takes a simulator from a build that did
  * not end for the one before it.
  */
object KeptSimulators extends Simulator {
  case object annotation extends SimulatorAnnotation {
    override def getSimulator: Simulator = KeptSimulators
  }

  /** Files of a test's folder: the key of its simulator, and that of chiseltest. */
  private val keys = Seq("simulator.key", "caching.hash")

  private val verilator = VerilatorBackendAnnotation.getSimulator

  override def name: String                  = verilator.name
  override def isAvailable: Boolean          = verilator.isAvailable
  override def waveformFormats               = verilator.waveformFormats
  override def supportsCoverage: Boolean     = verilator.supportsCoverage
  override def supportsLiveCoverage: Boolean = verilator.supportsLiveCoverage

  override def createContext(state: CircuitState): SimulatorContext = Mutants.choice.fold(keep(state)) { choice =>
    val (circuit, mutants) = Mutants.insert(state.circuit, choice)
    Mutants.present ++= mutants
    val context = keep(state.copy(circuit = circuit))
    context.poke(Mutants.port, Mutants.active)
    new MutatedContext(context)
  }

  private def keep(state: CircuitState): SimulatorContext = {
    val folder = os.pwd / os.RelPath(state.annotations.collectFirst { case TargetDirAnnotation(name) => name }.get)
    val key    = keyOf(state)
    // Without keys, what a build leaves that does not end is never used
    if (!Try(os.read(folder / keys.head)).toOption.contains(key)) keys.foreach(name => os.remove(folder / name))
    val context = verilator.createContext(state.copy(annotations = CachingAnnotation +: state.annotations))
    // The simulator is loaded as a copy with a new name each time
    os.list(folder / "verilated").filter(_.last.matches(s"V${state.circuit.main}_\\d+")).foreach(os.remove(_))
    os.write.over(folder / keys.head, key)
    context
  }

  private def keyOf(state: CircuitState): String = {
    val circuit     = state.circuit.serialize.replaceAll(" @\\[[^\\]]*\\]", "")
    val annotations = state.annotations.map(annotation => JsonProtocol.serialize(Seq(annotation))).sorted
    val digest      = MessageDigest.getInstance("SHA-256")
    for (part <- circuit +: (annotations ++ tools)) digest.update(s"${part.length}:$part".getBytes(UTF_8))
    digest.digest().map(byte => f"$byte%02x").mkString
  }

  /** What turns a circuit into a simulator. */
  private lazy val tools: Seq[String] = {
    val versions =
      Seq("verilator", "g++").map(program => Try(Process(s"$program --version").!!(ProcessLogger(_ => ()))))
    val script = os.read(os.pwd / "tools" / "verilated-object")
    val java   = Seq("java.home", "java.version").map(System.getProperty)
    val jars   = System.getProperty("java.class.path").split(":").map(_.split("/").last).filter(_.endsWith(".jar"))
    versions.map(_.toString) ++ Seq(script, sys.env.getOrElse("MAKEFLAGS", "")) ++ java ++ jars.sorted
  }
}

/** Counts cycles, as a fault may keep a test from its end. */
private class MutatedContext(context: SimulatorContext) extends SimulatorContext {
  override def sim: Simulator = context.sim

  override def step(cycles: Int): StepResult = {
    Mutants.cycles += cycles
    if (Mutants.cycles > Mutants.limit) throw new IllegalStateException("no end")
    context.step(cycles)
  }

  override def peek(signal:     String): BigInt                           = context.peek(signal)
  override def poke(signal:     String, value: BigInt): Unit              = context.poke(signal, value)
  override def peekMemory(name: String, at:    Long): BigInt              = context.peekMemory(name, at)
  override def pokeMemory(name: String, at:    Long, value: BigInt): Unit = context.pokeMemory(name, at, value)
  override def finish(): Unit                                             = context.finish()
  override def getCoverage(): List[(String, Long)]                        = context.getCoverage()
  override def resetCoverage(): Unit                                      = context.resetCoverage()
}

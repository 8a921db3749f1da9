package colonnade.ray

import chisel3._
import chisel3.util.Cat
import colonnade.common.DelayLine
import colonnade.config.PathConfig
import colonnade.numbers.PipelinedDivider

/** Prepares a ray a cycle for traversal, in order and bit for bit as [[SequentialRaySetup]]: docs/traversal.md, ray set-up.
  *
  * Latency: [[SetupStages.count]] cycles, 18 with 24-bit triangle tests. All stages stall together while the offered ray is
  * not taken; a stage without a ray keeps its values. `busy`: a ray enters. Source: docs/numbers.md, section 2.
  */
final class RaySetupPipeline(config: PathConfig) extends RaySetup(config) {
  private val numbers = config.numbers
  private val stages  = new SetupStages(numbers)

  // Control: a stage loads if the stage before it holds a ray
  private val holdsRay = RegInit(VecInit(Seq.fill(stages.count)(false.B)))
  private val moves    = !holdsRay.last || io.ray.ready
  private val arrives  = io.request.valid +: holdsRay.init
  private val loads    = VecInit(arrives.map(_ && moves))
  private val shifts   = moves && holdsRay.asUInt.orR
  when(moves) { holdsRay.zip(arrives).foreach { case (to, from) => to := from } }
  io.request.ready := moves
  io.ray.valid     := holdsRay.last
  io.busy          := loads.head

  /** A value of a stage as it is in a later one. */
  private def delayed[T <: Data](value: T, from: Int, to: Int): T = {
    val line = Module(new DelayLine(chiselTypeOf(value), to - from)).io
    line.moves  := shifts
    line.writes := holdsRay(from)
    line.in     := value
    line.reads  := holdsRay(to - 1)
    line.out
  }

  // Mantissas and quotients
  private val direction = Module(new DirectionStages(config)).io
  direction.loads   := loads.take(2)
  direction.request := io.request.bits
  private val minor    = direction.mantissas.minor
  private val dominant = direction.mantissas.dominant

  private def divide(numerators: Seq[UInt], denominator: UInt, digits: Int): Seq[UInt] = {
    val divider = Module(new PipelinedDivider(numbers.mantissaBits, digits, numerators.size)).io
    divider.loads.zip(loads.drop(stages.mantissas + 1)).foreach { case (to, from) => to := from }
    divider.numerators.zip(numerators).foreach { case (to, from) => to := from }
    // The top bit, also of a component that is 0, whose quotient is not used
    divider.denominator := Cat(true.B, denominator(numbers.mantissaBits - 2, 0))
    divider.quotients
  }
  private val shearQuotients      = divide(minor, dominant, numbers.shearDigits)
  private val reciprocalQuotients = minor.flatMap(each => divide(Seq(dominant), each, numbers.reciprocalDigits))

  // The ray, when the reciprocals are almost there
  private val fetched     = delayed(direction.ray, 0, stages.fetchedRay)
  private val registers   = new StageRegisters(loads)
  private val reciprocals = reciprocalQuotients.zip(fetched.info.isTiny).map { case (quotient, tiny) =>
    val isOne = registers.hold(registers.load(tiny, stages.unitOrigins), stages.unitOrigins, stages.reciprocals)
    val one   = (BigInt(1) << numbers.reciprocalFraction).U
    Mux(isOne, one, quotient << (numbers.reciprocalFraction - numbers.reciprocalDigits))
  }

  // The entry, and the advance to it
  private val entry = Module(new EntryStages(config)).io
  entry.loads       := loads
  entry.bounds      := io.bounds
  entry.ray         := fetched
  entry.reciprocals := reciprocals

  private val advancing = Wire(new AdvancingRay(config))
  advancing.context     := fetched.info.context
  advancing.isShadow    := fetched.info.isShadow
  advancing.orientation := fetched.info.orientation
  advancing.origin      := fetched.origin
  advancing.tMax        := fetched.tMax
  advancing.limits.zip(fetched.limits).foreach { case (to, from) => to := from }
  advancing.visit.zip(fetched.info.visit).foreach { case (to, from) => to := from }
  advancing.exponent.zip(fetched.info.exponent).zip(fetched.info.isTiny).foreach { case ((to, from), tiny) =>
    to := Mux(tiny, numbers.reciprocalFraction.U, from)
  }

  private val advance = Module(new AdvanceStages(config)).io
  advance.loads          := loads
  advance.exponents      := fetched.info.exponent
  advance.shearQuotients := shearQuotients
  advance.reciprocals    := reciprocals
  advance.tNear          := registers.hold(entry.tNear, stages.entry, stages.operands)
  advance.ray            := delayed(advancing, stages.fetchedRay, stages.advances)
  advance.enters         := registers.hold(entry.enters, stages.enters, stages.advances)
  io.ray.bits            := advance.output
}

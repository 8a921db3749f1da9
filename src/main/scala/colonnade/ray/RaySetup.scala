package colonnade.ray

import chisel3._
import chisel3.util.{Cat, Decoupled}
import colonnade.common.DelayLine
import colonnade.config.{PathConfig, UnitsConfig}
import colonnade.formats.Bounds
import colonnade.numbers.{Divider, PipelinedDivider}

final class RaySetupIO(config: PathConfig) extends Bundle {
  val request = Flipped(Decoupled(new RayRequest(config)))
  val bounds  = Input(new Bounds(config.numbers)) // constant while a ray is in the unit
  val ray     = Decoupled(new PreparedRay(config))

  /** The longest stage, [[RayEntry]], holds a ray; of a [[RaySetupPipeline]]: a ray enters. */
  val busy = Output(Bool())
}

/** Prepares rays for traversal: docs/numbers.md, section 2. In order. */
abstract class RaySetup(config: PathConfig) extends Module {
  final val io = IO(new RaySetupIO(config))
}

object RaySetup {

  /** The smallest unit that takes a ray every `units.rayInterval` cycles. */
  def apply(config: PathConfig): RaySetup =
    if (config.device.units.rayInterval >= UnitsConfig.sequentialRayInterval) new SequentialRaySetup(config)
    else new RaySetupPipeline(config)
}

/** Prepares a ray a cycle for traversal, in order and bit for bit as [[SequentialRaySetup]]: docs/traversal.md, ray
  * set-up.
  *
  * Latency: [[SetupStages.count]] cycles, 18 with 24-bit triangle tests. All stages stall together while the offered
  * ray is not taken; a stage without a ray keeps its values. `busy`: a ray enters. Source: docs/numbers.md, section 2.
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

/** Prepares rays for traversal, one after the other and in order, with up to three rays in flight: docs/traversal.md.
  *
  * With quotients of 31 and 19 bits, the latency is about 30 cycles and the throughput at least one ray every 16
  * cycles; it is one every 27 cycles at the widest formats with extra slices. The quotients of a component that is 0
  * are computed, then replaced. A direction of 0 gives a ray that does not enter the box. Source: docs/numbers.md,
  * section 2.
  */
final class SequentialRaySetup(config: PathConfig) extends RaySetup(config) {
  private val numbers = config.numbers

  private val normaliser = Module(new DirectionNormaliser(config))
  private val shears = Seq.fill(2)(Module(new Divider(numbers.mantissaBits, numbers.shearDigits, digitsPerCycle = 2)))
  private val reciprocals = Seq.fill(2)(Module(new Divider(numbers.mantissaBits, numbers.reciprocalDigits)))
  private val entry       = Module(new RayEntry(config))
  private val dividers    = shears ++ reciprocals

  normaliser.io.request :<>= io.request
  entry.io.ray :<>= normaliser.io.ray
  entry.io.bounds := io.bounds
  io.ray :<>= entry.io.output
  io.busy := entry.io.busy

  // All dividers start together, and their quotients are taken together
  private val mantissas = normaliser.io.mantissas
  private val areFree   = dividers.map(_.io.division.ready).reduce(_ && _)
  mantissas.ready := areFree
  dividers.foreach(_.io.division.valid := mantissas.valid && areFree)
  shears.zip(mantissas.bits.minor).foreach { case (divider, minor) =>
    divider.io.division.bits.numerator   := minor
    divider.io.division.bits.denominator := normalised(mantissas.bits.dominant)
  }
  reciprocals.zip(mantissas.bits.minor).foreach { case (divider, minor) =>
    divider.io.division.bits.numerator   := mantissas.bits.dominant
    divider.io.division.bits.denominator := normalised(minor)
  }

  private val areDone = dividers.map(_.io.quotient.valid).reduce(_ && _)
  entry.io.quotients.valid := areDone
  dividers.foreach(_.io.quotient.ready := areDone && entry.io.quotients.ready)
  entry.io.quotients.bits.shear.zip(shears).foreach { case (to, divider) => to := divider.io.quotient.bits }
  entry.io.quotients.bits.reciprocal.zip(reciprocals).foreach { case (to, divider) => to := divider.io.quotient.bits }

  /** Sets the top bit, also of a component that is 0, whose quotient is not used. */
  private def normalised(mantissa: UInt): UInt = Cat(true.B, mantissa(numbers.mantissaBits - 2, 0))
}

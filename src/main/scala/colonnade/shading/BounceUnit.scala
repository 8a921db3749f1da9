package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, Mux1H, PriorityEncoderOH}
import colonnade.config.PathConfig
import colonnade.microcode.Microprogram

final class BounceUnitIO(config: PathConfig) extends Bundle {

  /** The register `shading.offset`; constant while the unit is busy. */
  val offset  = Input(UInt((config.numbers.gridBits - 2).W))
  val request = Flipped(Decoupled(new BounceRequest(config)))
  val result  = Decoupled(new BounceResult(config))

  val busy = Output(Bool()) // holds a bounce
}

/** Reflection at mirrors; refraction and Schlick's Fresnel term at glass: docs/numbers.md, section 6, and
  * docs/shading.md.
  *
  * One bounce at a time, in a program whose products take two cycles or more. The shading normal is the smooth one,
  * unless that turns away from the ray or would send it to the wrong side of the surface: then the program starts over
  * with the geometric one. At 32b32s64d a mirror takes 44 cycles, glass 104 from behind and about 170 from the front. A
  * restart adds 25 cycles, or all cycles so far and 11.
  */
final class BounceUnit(config: PathConfig) extends Module {
  private val formats = new BounceFormats(config.numbers)

  val io = IO(new BounceUnitIO(config))

  private val datapath   = Module(new BounceDatapath(config))
  private val control    = Wire(new BounceControl(formats))
  private val decoded    = WireInit(0.U.asTypeOf(new BounceControl(formats)))
  private val state      = new BounceState
  private val moreDigits = Wire(Bool())
  private val sequence   =
    new BounceProgram(decoded, state, datapath.io.status, io.request.fire, io.result.ready, moreDigits)
  val program: Microprogram[BounceLabel] = sequence.program

  private val isIdle = program.isAt(BounceLabel.Idle)
  program.build()

  // The digits of a product, highest first
  private val products   = decoded.products
  private val digitsLeft = RegInit(0.U(control.digit.getWidth.W))
  private val isFirst    = digitsLeft === 0.U
  private val firstDigit = Mux(products.isLong, (formats.longDigits - 1).U, (formats.digits - 1).U)
  private val digit      = Mux(isFirst, firstDigit, digitsLeft - 1.U)
  moreDigits := products.any && digit =/= 0.U
  digitsLeft := Mux(program.isStalled, digit, 0.U)

  when(io.request.fire) {
    state.isGlass      := io.request.bits.isGlass
    state.isSmooth     := io.request.bits.isSmooth
    state.backSide     := io.request.bits.backSide
    state.isRefraction := false.B
    state.hasFresnel   := false.B
  }

  io.request.ready := isIdle
  io.result.valid  := program.isAt(BounceLabel.Done)
  io.busy          := !isIdle

  control         := decoded
  control.isFirst := isFirst
  control.digit   := digit
  when(!isFirst)(control.actions := 0.U.asTypeOf(control.actions))

  datapath.io.control      := control
  datapath.io.request      := io.request.bits
  datapath.io.offset       := io.offset
  datapath.io.isRefraction := state.isRefraction
  io.result.bits           := datapath.io.result
  when(!state.hasFresnel)(io.result.bits.fresnel.raw := 0.U)
}

/** [[BounceUnit]] with several hits at a time: docs/shading.md. Mirrors take a [[MirrorPipeline]], a hit every three
  * cycles; glass takes one of several units. Results come in any order; the hits in it are of different contexts.
  */
final class BouncePipeline(config: PathConfig) extends Module {
  val io = IO(new BounceUnitIO(config))

  private val mirrors = Module(new MirrorPipeline(config)).io
  private val glass   = Seq.fill(BouncePipeline.units)(Module(new BounceUnit(config)).io)
  private val units   = mirrors +: glass

  // A mirror waits for the pipeline, glass for an idle unit
  private val isGlass = io.request.bits.isGlass
  private val isIdle  = glass.map(_.request.ready)
  private val takes   = (!isGlass +: PriorityEncoderOH(isIdle).map(_ && isGlass))
  io.request.ready := Mux(isGlass, isIdle.reduce(_ || _), mirrors.request.ready)
  for ((unit, takes) <- units.zip(takes)) {
    unit.offset        := io.offset
    unit.request.valid := io.request.valid && takes
    unit.request.bits  := io.request.bits
  }
  io.busy := units.map(_.busy).reduce(_ || _)

  // A result is chosen, and offered until it is taken; the next one is another unit's
  private val chosen = RegInit(VecInit.fill(units.size)(false.B))
  private val others = units.zip(chosen).map { case (unit, isLast) => unit.result.valid && !isLast }
  when(!io.result.valid || io.result.ready) { chosen := VecInit(PriorityEncoderOH(others)) }
  io.result.valid                                             := chosen.reduce(_ || _)
  io.result.bits                                              := Mux1H(chosen, units.map(_.result.bits))
  for ((unit, isNext) <- units.zip(chosen)) unit.result.ready := isNext && io.result.ready
}

object BouncePipeline {
  val units: Int = 4 // units for glass: a hit at its front takes some 170 cycles in each
}

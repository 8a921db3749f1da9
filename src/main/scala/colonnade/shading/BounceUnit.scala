package colonnade.shading

import chisel3._
import chisel3.util.Decoupled
import colonnade.config.ColonnadeConfig

final class BounceUnitIO(config: ColonnadeConfig) extends Bundle {

  /** The register `shading.offset`; constant while a bounce is in work. */
  val offset  = Input(UInt((config.numbers.gridBits - 2).W))
  val request = Flipped(Decoupled(new BounceRequest(config)))
  val result  = Decoupled(new BounceResult(config))

  /** Holds a bounce. */
  val busy = Output(Bool())
}

/** Reflection at mirrors, refraction and Schlick's share at glass: docs/numbers.md, section 6; docs/bounce.md.
  *
  * One bounce at a time, in a program of one product in two cycles or more. The shading normal is the smooth one, unless
  * that turns away from the ray or would send it to the wrong side of the surface: then the program starts over with the
  * geometric one. At 32b32s64d a mirror takes 44 cycles, glass 104 from behind and some 170 from the front; to start over
  * takes 25 or as many as so far and 11.
  */
final class BounceUnit(config: ColonnadeConfig) extends Module {
  private val formats = new BounceFormats(config.numbers)
  private val program = new BounceProgram

  val io = IO(new BounceUnitIO(config))

  private val datapath     = Module(new BounceDatapath(config))
  private val isBusy       = RegInit(false.B)
  private val step         = RegInit(program.last.U(program.stepBits.W))
  private val isDone       = step === program.last.U
  private val isGlass      = Reg(Bool())
  private val isSmooth     = Reg(Bool())
  private val isRefraction = Reg(Bool())
  private val backSide     = Reg(Bool())

  /** There is a share. */
  private val isShared = Reg(Bool())

  private val nextStep = Wire(chiselTypeOf(step))
  private val work     = program.work(step)
  private val control  = Wire(new BounceControl(formats))

  /** Of the step; decoded a step ahead, since they are where the slowest path begins. */
  private val factors = RegInit(0.U.asTypeOf(new BounceFactors))

  /** Digits that this step has still to multiply after its first cycle. */
  private val digitsLeft = RegInit(0.U(control.digit.getWidth.W))
  private val isFirst    = digitsLeft === 0.U
  private val firstDigit = Mux(factors.isLong, (formats.longDigits - 1).U, (formats.digits - 1).U)
  private val digit      = Mux(isFirst, firstDigit, digitsLeft - 1.U)

  private def at(other: Int): Bool = step === other.U

  // Of the sum
  private val isPositive  = datapath.io.isPositive
  private val isNegative  = datapath.io.isNegative
  private val isWrongSide = Mux(isRefraction, !isNegative, !isPositive)
  private val startOver   =
    isBusy && isSmooth && ((at(program.checkFacing) && !isPositive) || (at(program.checkSide) && isWrongSide))

  nextStep   := step
  digitsLeft := 0.U
  when(io.request.fire) {
    isBusy       := true.B
    nextStep     := program.measure.U
    isGlass      := io.request.bits.isGlass
    isSmooth     := io.request.bits.isSmooth
    backSide     := io.request.bits.backSide
    isRefraction := false.B
    isShared     := false.B
  }.elsewhen(startOver) {
    nextStep     := 0.U
    isSmooth     := false.B
    isRefraction := false.B
  }.elsewhen((at(program.checkGlass) && !isGlass) || (at(program.checkRest) && isNegative)) {
    nextStep := program.side.U
  }.elsewhen((at(program.checkSide) && !isRefraction) || (at(program.checkShare) && backSide)) {
    nextStep := program.last.U
  }.elsewhen(at(program.cosineRoot) && !isPositive) {
    nextStep := program.away.U
  }.elsewhen(factors.any && digit =/= 0.U) {
    digitsLeft := digit
  }.elsewhen(!isDone && !datapath.io.waits) {
    nextStep := step + 1.U
  }
  step    := nextStep
  factors := program.factors(nextStep)
  when(at(program.checkRest) && !isNegative)(isRefraction := true.B)
  when(at(program.checkShare) && !backSide)(isShared      := true.B)
  when(io.result.fire)(isBusy                             := false.B)

  io.request.ready := !isBusy
  io.result.valid  := isBusy && isDone
  io.busy          := isBusy

  control.load      := io.request.fire
  control.startOver := startOver
  control.factors   := factors
  control.isFirst   := isFirst
  control.digit     := digit
  control.work      := Mux(isFirst, work, 0.U.asTypeOf(work))

  datapath.io.control      := control
  datapath.io.request      := io.request.bits
  datapath.io.offset       := io.offset
  datapath.io.isRefraction := isRefraction
  io.result.bits           := datapath.io.result
  when(!isShared)(io.result.bits.share.raw := 0.U)
}

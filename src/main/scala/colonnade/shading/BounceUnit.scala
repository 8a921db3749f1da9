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

/** Reflection at mirrors, refraction and Schlick's share at glass: docs/bounce.md.
  *
  * One bounce at a time, in a program of one step a cycle. The shading normal is the smooth one, unless that turns away
  * from the ray or would send it to the wrong side of the surface: then the program starts over with the geometric one.
  */
final class BounceUnit(config: ColonnadeConfig) extends Module {
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

  private def at(other: Int): Bool = step === other.U

  // Of the sum
  private val isPositive  = datapath.io.isPositive
  private val isNegative  = datapath.io.isNegative
  private val isWrongSide = Mux(isRefraction, !isNegative, !isPositive)
  private val startOver   =
    isBusy && isSmooth && ((at(program.checkFacing) && !isPositive) || (at(program.checkSide) && isWrongSide))

  when(io.request.fire) {
    isBusy       := true.B
    step         := program.measure.U
    isGlass      := io.request.bits.isGlass
    isSmooth     := io.request.bits.isSmooth
    backSide     := io.request.bits.backSide
    isRefraction := false.B
    isShared     := false.B
  }.elsewhen(startOver) {
    step         := 0.U
    isSmooth     := false.B
    isRefraction := false.B
  }.elsewhen((at(program.checkGlass) && !isGlass) || (at(program.checkRest) && isNegative)) {
    step := program.side.U
  }.elsewhen((at(program.checkSide) && !isRefraction) || (at(program.checkShare) && backSide)) {
    step := program.last.U
  }.elsewhen(at(program.cosineRoot) && !isPositive) {
    step := program.away.U
  }.elsewhen(!isDone && !datapath.io.waits) {
    step := step + 1.U
  }
  when(at(program.checkRest) && !isNegative)(isRefraction := true.B)
  when(at(program.checkShare) && !backSide)(isShared      := true.B)
  when(io.result.fire)(isBusy                             := false.B)

  io.request.ready := !isBusy
  io.result.valid  := isBusy && isDone
  io.busy          := isBusy

  private val control = Wire(new BounceControl)
  control           := program.control(step)
  control.load      := io.request.fire
  control.startOver := startOver

  datapath.io.control      := control
  datapath.io.request      := io.request.bits
  datapath.io.offset       := io.offset
  datapath.io.isRefraction := isRefraction
  io.result.bits           := datapath.io.result
  when(!isShared)(io.result.bits.share.raw := 0.U)
}

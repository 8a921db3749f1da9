package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{Light, Shading}
import colonnade.microcode.Microprogram

final class ShaderGeometryIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val request = Flipped(Decoupled(new ShadeRequest(config)))

  /** Points of the environment; taken when there is no request. */
  val environment = if (config.device.hasEnvironment) Some(Flipped(Decoupled(new EnvironmentSurface(config)))) else None

  val readyNext = Output(Bool()) // `request` is ready in the next cycle
  val lights    = Input(Vec(config.device.frame.lights, new Light(numbers)))
  val shading   = Input(new Shading(config.device))

  /** Results of the current hit: one per light, at least one. */
  val lightCount = Input(UInt(NumberFormats.bitLength(config.device.frame.lights).W))
  val unitShift  = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** To the multiplier, whose product comes in the next cycle. */
  val operands = Valid(new MultiplierOperands(formats))
  val product  = Input(SInt(formats.productBits.W))
  val result   = Decoupled(new ShadingPoint(config))
}

/** Computes a hit's point and shading normal, and for each light the direction to it and its angle to the normal:
  * docs/numbers.md, 5.1 to 5.6 and the product of 5.7. This module is the control; [[GeometryDatapath]] computes.
  *
  * One hit at a time, one result per light, in order; one result if no light shines. Latency 36 cycles and two for each
  * digit of a shear factor (two digits at 32 bits), see [[GeometryProgram]]; 20 for each further light. A hit whose
  * smooth normal is zero takes 12 cycles more, for a second start with the geometric normal.
  */
final class ShaderGeometry(config: PathConfig) extends Module {
  private val formats = new ShaderFormats(config.numbers)

  val io = IO(new ShaderGeometryIO(config))

  private val datapath   = Module(new GeometryDatapath(config))
  private val control    = WireInit(0.U.asTypeOf(new GeometryControl(formats)))
  private val conditions = new GeometryConditions
  private val sequence   = new GeometryProgram(formats, control, conditions, ShaderMultiplier.latency(config))
  val program: Microprogram[GeometryLabel] = sequence.program

  private val isIdle = program.isAt(GeometryLabel.Idle)

  /** Shade with the geometric normal: the registers say so, or the smooth normal is zero. */
  private val isFlat        = Reg(Bool())
  private val light         = Reg(UInt(log2Ceil(config.device.frame.lights.max(2)).W))
  private val isLast        = light +& 1.U >= io.lightCount
  private val isEnvironment = io.environment.map(_.fire).getOrElse(false.B)
  private val takes         = io.request.fire || isEnvironment
  private val startsOver    = datapath.io.normalIsZero && !isFlat

  conditions.takes        := takes
  conditions.startsOver   := startsOver
  conditions.isFirstLight := light === 0.U
  conditions.isTaken      := io.result.ready
  conditions.isLast       := isLast
  program.build()

  when(takes) {
    light  := 0.U
    isFlat := io.shading.flat || isEnvironment
  }.elsewhen(control.latchNormalZeros && startsOver) {
    isFlat := true.B
  }
  when(io.result.fire)(light := light + 1.U)

  io.request.ready := isIdle
  io.environment.foreach(_.ready := isIdle && !io.request.valid)
  io.readyNext    := (isIdle && !io.request.valid && !isEnvironment) || (io.result.fire && isLast)
  io.result.valid := program.isAt(GeometryLabel.Done)

  datapath.io.control := control
  // The program's signal comes early, without the condition
  datapath.io.control.squareNormal := control.squareNormal && conditions.isFirstLight
  datapath.io.request              := io.request.bits
  datapath.io.isEnvironment        := isEnvironment
  datapath.io.environment.zip(io.environment).foreach { case (to, environment) => to := environment.bits }
  datapath.io.isFlat    := isFlat
  datapath.io.light     := io.lights(if (config.device.frame.lights == 1) 0.U else light)
  datapath.io.offset    := io.shading.offset
  datapath.io.unitShift := io.unitShift
  datapath.io.product   := io.product
  io.operands           := datapath.io.operands

  io.result.bits.light   := light
  io.result.bits.isLast  := isLast
  io.result.bits.angle   := datapath.io.angle
  io.result.bits.falloff := datapath.io.falloff
  io.result.bits.surface := datapath.io.surface
}

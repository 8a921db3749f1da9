package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{Light, Shading}

final class ShaderGeometryIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val request = Flipped(Decoupled(new ShadeRequest(config)))

  /** Points of the room; taken when there is no request. */
  val room = if (config.hasRoom) Some(Flipped(Decoupled(new RoomSurface(config)))) else None

  /** `request` will be ready in the next cycle. */
  val readyNext = Output(Bool())
  val lights    = Input(Vec(config.frame.lights, new Light(numbers)))
  val shading   = Input(new Shading(config))

  /** Results wanted of the hit in work; one at least. */
  val lightCount = Input(UInt(NumberFormats.bitLength(config.frame.lights).W))
  val unitShift  = Input(UInt(NumberFormats.bitLength(numbers.sceneBits).W))

  /** To the multiplier, which answers in the next cycle. */
  val factors = Valid(new Factors(formats))
  val product = Input(SInt(formats.productBits.W))
  val result  = Decoupled(new ShadingPoint(config))
}

/** Where a hit lies, which way its lights are, and the angle between that and its shading normal: docs/numbers.md, 5.1
  * to 5.6 and the product of 5.7. This is the control; the numbers are in [[GeometryDatapath]].
  *
  * One hit at a time, a result for each light, in order; one also if no light shines. Latency 36 cycles and two for each
  * digit of a slope (two at 32 bits): see [[GeometryProgram]]; 20 for each further light. A hit whose smooth normal is
  * zero takes 12 cycles more, for a second start with the geometric one.
  */
final class ShaderGeometry(config: ColonnadeConfig) extends Module {
  private val formats = new ShaderFormats(config.numbers)
  private val program = new GeometryProgram(formats)

  val io = IO(new ShaderGeometryIO(config))

  private val datapath = Module(new GeometryDatapath(config))
  private val isBusy   = RegInit(false.B)
  private val step     = RegInit(program.last.U(program.stepBits.W))
  private val isDone   = step === program.last.U

  /** Shade with the geometric normal: it is asked for, or the smooth one is zero. */
  private val isFlat    = Reg(Bool())
  private val light     = Reg(UInt(log2Ceil(config.frame.lights.max(2)).W))
  private val isLast    = light +& 1.U >= io.lightCount
  private val isRoom    = io.room.map(_.fire).getOrElse(false.B)
  private val takes     = io.request.fire || isRoom
  private val control   = program.control(step, takes, isFirstLight = light === 0.U)
  private val startOver = control.countNormal && datapath.io.normalIsZero && !isFlat

  when(takes) {
    isBusy := true.B
    step   := 0.U
    light  := 0.U
    isFlat := io.shading.flat || isRoom
  }.elsewhen(startOver) {
    step   := 0.U
    isFlat := true.B
  }.elsewhen(!isDone) {
    step := step + 1.U
  }
  when(io.result.fire) {
    isBusy := !isLast
    light  := light + 1.U
    when(!isLast)(step := program.nextLight.U)
  }

  io.request.ready := !isBusy
  io.room.foreach(_.ready := !isBusy && !io.request.valid)
  io.readyNext    := (!isBusy && !io.request.valid && !isRoom) || (io.result.fire && isLast)
  io.result.valid := isBusy && isDone

  datapath.io.control := control
  datapath.io.request := io.request.bits
  datapath.io.isRoom  := isRoom
  datapath.io.room.zip(io.room).foreach { case (to, room) => to := room.bits }
  datapath.io.isFlat    := isFlat
  datapath.io.light     := io.lights(if (config.frame.lights == 1) 0.U else light)
  datapath.io.offset    := io.shading.offset
  datapath.io.unitShift := io.unitShift
  datapath.io.product   := io.product
  io.factors            := datapath.io.factors

  io.result.bits.light   := light
  io.result.bits.isLast  := isLast
  io.result.bits.angle   := datapath.io.angle
  io.result.bits.falloff := datapath.io.falloff
  io.result.bits.surface := datapath.io.surface
}

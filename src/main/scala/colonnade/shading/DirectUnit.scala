package colonnade.shading

import chisel3._
import chisel3.util.{is, switch, Decoupled, MuxLookup, ShiftRegister}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Rgb}
import colonnade.numbers.{Fixed, Rounding}

final class DirectUnitIO(config: PathConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val brightness = Flipped(Decoupled(new Brightness(numbers)))
  val colour     = Input(Rgb(FrameRegisters.intensity)) // the light's intensity, constant while the unit works on it

  /** To the multiplier, whose product comes `ShaderMultiplier.latency` cycles after it took them. */
  val operands = Decoupled(new MultiplierOperands(formats))
  val product  = Input(SInt(formats.productBits.W))
  val direct   = Decoupled(Rgb(FrameRegisters.intensity))
}

private object DirectStep extends ChiselEnum {

  /** `applyFalloff` multiplies cosine and falloff, `scaleColour` the result and each channel of the light. */
  val idle, applyFalloff, awaitFalloff, scaleColour, awaitColour, done = Value
}

/** The direct light of a point light on a surface, without shadows: docs/numbers.md, 5.8.
  *
  * One light at a time: four products and three cycles (five with a multiplier of two cycles), more while the
  * multiplier is busy.
  */
final class DirectUnit(config: PathConfig) extends Module {
  private val formats = new ShaderFormats(config.numbers)

  val io = IO(new DirectUnitIO(config))

  private val step       = RegInit(DirectStep.idle)
  private val channel    = Reg(UInt(2.W))
  private val falloff    = Reg(Falloff())
  private val brightness = Reg(UInt(formats.brightnessBits.W))
  private val direct     = Reg(Vec(3, UInt(NumberFormats.lightBits.W)))

  // Multiplier operands
  private val light         = io.colour.channels.map(_.natural)
  private val isFalloff     = step === DirectStep.applyFalloff
  private val channelColour = MuxLookup(channel, light(2))(Seq(0.U -> light(0), 1.U -> light(1)))
  io.operands.valid       := isFalloff || step === DirectStep.scaleColour
  io.operands.bits.wide   := brightness.zext.pad(formats.wideBits)
  io.operands.bits.narrow := Mux(isFalloff, falloff, channelColour).zext.pad(formats.narrowBits)

  // A product comes some cycles after its operands
  private val latency    = ShaderMultiplier.latency(config)
  private val hasArrived = if (latency == 1) true.B else ShiftRegister(io.operands.fire, latency, false.B, true.B)
  private val isArriving =
    ShiftRegister(io.operands.fire && step === DirectStep.scaleColour, latency, false.B, true.B)
  private val arrivingChannel = ShiftRegister(channel, latency)
  private val scaledChannel   =
    Rounding.saturate(Rounding.floor(io.product.asUInt, config.numbers.cosineFraction), NumberFormats.lightBits)
  when(isArriving)(direct(arrivingChannel) := scaledChannel)

  switch(step) {
    is(DirectStep.idle) {
      channel    := 0.U
      falloff    := io.brightness.bits.falloff
      brightness := io.brightness.bits.cosine
      when(io.brightness.fire)(step := DirectStep.applyFalloff)
    }
    is(DirectStep.applyFalloff) { when(io.operands.fire)(step := DirectStep.awaitFalloff) }
    is(DirectStep.awaitFalloff) {
      brightness :=
        Rounding.narrow(Rounding.floor(io.product.asUInt, NumberFormats.lightFraction), formats.brightnessBits)
      when(hasArrived)(step := DirectStep.scaleColour)
    }
    is(DirectStep.scaleColour) {
      when(io.operands.fire) {
        channel := channel + 1.U
        when(channel === 2.U)(step := DirectStep.awaitColour)
      }
    }
    is(DirectStep.awaitColour) {
      when(if (latency == 1) true.B else isArriving && arrivingChannel === 2.U)(step := DirectStep.done)
    }
    is(DirectStep.done) { when(io.direct.fire)(step := DirectStep.idle) }
  }

  io.brightness.ready := step === DirectStep.idle
  io.direct.valid     := step === DirectStep.done
  io.direct.bits.channels.zip(direct).foreach { case (to, from) => to := Fixed(to.format, from) }
}

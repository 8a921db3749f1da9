package colonnade.shading

import chisel3._
import chisel3.util.{is, switch, Decoupled, MuxLookup}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Rgb}
import colonnade.numbers.{Fixed, Rounding}

final class DirectUnitIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val brightness = Flipped(Decoupled(new Brightness(numbers)))

  /** The light's, constant while it is in work. */
  val colour = Input(Rgb(FrameRegisters.intensity))

  /** To the multiplier, which answers in the cycle after it took them. */
  val factors = Decoupled(new Factors(formats))
  val product = Input(SInt(formats.productBits.W))
  val direct  = Decoupled(Rgb(FrameRegisters.intensity))
}

private object DirectStep extends ChiselEnum {

  /** Cosine · falloff; wait for it; light · that, for each channel; wait for the last one. */
  val idle, fall, fallen, shine, shone, done = Value
}

/** What a light gives to a surface, unless something is in its way: docs/numbers.md, 5.8.
  *
  * One light at a time: four products and three cycles, more while the multiplier is taken.
  */
final class DirectUnit(config: ColonnadeConfig) extends Module {
  private val formats = new ShaderFormats(config.numbers)

  val io = IO(new DirectUnitIO(config))

  private val step       = RegInit(DirectStep.idle)
  private val channel    = Reg(UInt(2.W))
  private val falloff    = Reg(Falloff())
  private val brightness = Reg(UInt(formats.brightnessBits.W))
  private val direct     = Reg(Vec(3, UInt(NumberFormats.lightBits.W)))

  // Factors
  private val light         = io.colour.channels.map(_.natural)
  private val falls         = step === DirectStep.fall
  private val channelColour = MuxLookup(channel, light(2))(Seq(0.U -> light(0), 1.U -> light(1)))
  io.factors.valid       := falls || step === DirectStep.shine
  io.factors.bits.wide   := brightness.zext.pad(formats.wideBits)
  io.factors.bits.narrow := Mux(falls, falloff, channelColour).zext.pad(formats.narrowBits)

  // A channel's product comes in the cycle after it was taken
  private val isArriving      = RegNext(io.factors.fire && step === DirectStep.shine, false.B)
  private val arrivingChannel = RegNext(channel)
  private val shining         =
    Rounding.saturate(Rounding.floor(io.product.asUInt, config.numbers.cosineFraction), NumberFormats.lightBits)
  when(isArriving)(direct(arrivingChannel) := shining)

  switch(step) {
    is(DirectStep.idle) {
      channel    := 0.U
      falloff    := io.brightness.bits.falloff
      brightness := io.brightness.bits.cosine
      when(io.brightness.fire)(step := DirectStep.fall)
    }
    is(DirectStep.fall) {
      when(io.factors.fire)(step := DirectStep.fallen)
    }
    is(DirectStep.fallen) {
      brightness := Rounding.narrow(
        Rounding.floor(io.product.asUInt, NumberFormats.lightFraction),
        formats.brightnessBits
      )
      step := DirectStep.shine
    }
    is(DirectStep.shine) {
      when(io.factors.fire) {
        channel := channel + 1.U
        when(channel === 2.U)(step := DirectStep.shone)
      }
    }
    is(DirectStep.shone)(step := DirectStep.done)
    is(DirectStep.done) {
      when(io.direct.fire)(step := DirectStep.idle)
    }
  }

  io.brightness.ready := step === DirectStep.idle
  io.direct.valid     := step === DirectStep.done
  io.direct.bits.channels.zip(direct).foreach { case (to, from) => to := Fixed(to.format, from) }
}

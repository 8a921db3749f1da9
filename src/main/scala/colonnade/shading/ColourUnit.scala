package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.{FrameRegisters, Light, Material, RecordFormats, Rgb}
import colonnade.numbers.Rounding

/** Both colours that a hit's pixel may have. */
final class HitColours extends Bundle {
  val lit     = Rgb(FrameRegisters.colour)
  val ambient = Rgb(FrameRegisters.colour)
}

final class ColourUnitIO(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val cosine = Flipped(Decoupled(UInt(formats.cosineBits.W)))

  /** Constant from before the cosine until the colours are taken. */
  val material  = Input(UInt(RecordFormats.materialBits.W))
  val materials = Input(Vec(config.frame.materials, new Material))
  val light     = Input(new Light(numbers))
  val ambient   = Input(Rgb(FrameRegisters.intensity))

  /** To the multiplier, which answers in the cycle after it took them. */
  val factors = Decoupled(new Factors(formats))
  val product = Input(SInt(formats.productBits.W))
  val colours = Decoupled(new HitColours)
}

private object ColourStep extends ChiselEnum {

  /** Of each channel, in this order: light · cosine, albedo · ambient, albedo · (ambient + direct). */
  val idle, direct, ambient, lit, done = Value
}

/** The colours of a hit: docs/numbers.md, 5.8.
  *
  * One hit at a time: nine products, one a cycle while the multiplier is free, and two cycles. A material's index beyond
  * the table takes any of its entries; the packer writes none. Where the table's size is a power of two, it counts
  * modulo the size, as in the model.
  */
final class ColourUnit(config: ColonnadeConfig) extends Module {
  private val formats = new ShaderFormats(config.numbers)

  val io = IO(new ColourUnitIO(config))

  private val step    = RegInit(ColourStep.idle)
  private val channel = Reg(UInt(2.W))
  private val cosine  = Reg(UInt(formats.cosineBits.W))

  /** Light that falls onto the surface. */
  private val incoming = Reg(UInt((NumberFormats.lightBits + 1).W))
  private val lit      = Reg(Vec(3, FrameRegisters.colour))
  private val ambient  = Reg(Vec(3, FrameRegisters.colour))

  private def ofChannel(colour: Seq[UInt]): UInt = VecInit(colour :+ colour.last)(channel)

  private val index =
    if (config.frame.materials == 1) 0.U else Rounding.narrow(io.material, log2Ceil(config.frame.materials))
  private val lightNow   = ofChannel(io.light.colour.channels.map(_.natural))
  private val ambientNow = ofChannel(io.ambient.channels.map(_.natural))

  /** A cycle late: no step in which the channel changes looks at it. */
  private val albedo = RegNext(ofChannel(io.materials(index).albedo.channels))

  // The product of this step comes in the next cycle, whatever that does
  private val taken   = io.factors.fire
  private val product = io.product.asUInt
  private val direct  = Rounding.narrow(Rounding.floor(product, config.numbers.cosineFraction), NumberFormats.lightBits)
  private val colour  = Rounding.saturate(Rounding.floor(product, NumberFormats.lightFraction), NumberFormats.colourBits)

  private def arrives(of: ColourStep.Type): Bool = RegNext(taken && step === of, false.B)

  private def push(channels: Vec[UInt]): Unit = {
    channels(0) := channels(1)
    channels(1) := channels(2)
    channels(2) := colour
  }

  when(arrives(ColourStep.direct))(incoming := ambientNow +& direct)
  when(arrives(ColourStep.ambient))(push(ambient))
  private val litArrives = arrives(ColourStep.lit)
  when(litArrives)(push(lit))

  private val isIntensity = step === ColourStep.direct
  io.factors.valid       := isIntensity || step === ColourStep.ambient || step === ColourStep.lit
  io.factors.bits.wide   :=
    Mux(isIntensity, cosine, Mux(step === ColourStep.ambient, ambientNow, incoming)).zext.pad(formats.wideBits)
  io.factors.bits.narrow := Mux(isIntensity, lightNow, albedo).zext.pad(formats.narrowBits)

  // Control
  when(io.cosine.fire) {
    cosine  := io.cosine.bits
    channel := 0.U
    step    := ColourStep.direct
  }
  when(taken) {
    step := Mux(isIntensity, ColourStep.ambient, Mux(step === ColourStep.ambient, ColourStep.lit, ColourStep.direct))
    when(step === ColourStep.lit) {
      channel := channel + 1.U
      when(channel === 2.U)(step := ColourStep.done)
    }
  }
  when(io.colours.fire)(step := ColourStep.idle)

  io.cosine.ready         := step === ColourStep.idle
  io.colours.valid        := step === ColourStep.done && !litArrives
  io.colours.bits.lit     := toRgb(lit)
  io.colours.bits.ambient := toRgb(ambient)

  private def toRgb(channels: Vec[UInt]): Rgb[UInt] = {
    val rgb = Wire(Rgb(FrameRegisters.colour))
    rgb.channels.zip(channels).foreach { case (to, from) => to := from }
    rgb
  }
}

package colonnade.shading

import chisel3._
import chisel3.util.{is, log2Ceil, switch, Decoupled, MuxLookup}
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

  /** The hit's material. */
  val material = Flipped(Decoupled(UInt(RecordFormats.materialBits.W)))

  /** The same hit's cosine. */
  val cosine = Flipped(Decoupled(UInt(formats.cosineBits.W)))

  /** Constant while a hit is in work. */
  val materials = Input(Vec(config.frame.materials, new Material))
  val light     = Input(new Light(numbers))
  val ambient   = Input(Rgb(FrameRegisters.intensity))

  /** To the multiplier, which answers in the cycle after it took them. */
  val factors = Decoupled(new Factors(formats))
  val product = Input(SInt(formats.productBits.W))
  val colours = Decoupled(new HitColours)
}

private object ColourStep extends ChiselEnum {

  /** Albedo · ambient; then wait for the cosine; light · cosine; albedo · (ambient + direct). */
  val idle, ambient, cosine, direct, lit, done = Value
}

/** The colours of a hit: docs/numbers.md, 5.8.
  *
  * One hit at a time: three products, of which nothing waits for the cosine, then six more; one a cycle while the
  * multiplier is free, and two cycles. A material's index beyond the table takes any of its entries; the packer writes
  * none. Where the table's size is a power of two, it counts modulo the size, as in the model.
  */
final class ColourUnit(config: ColonnadeConfig) extends Module {
  private val formats = new ShaderFormats(config.numbers)
  private val indices = log2Ceil(config.frame.materials)

  val io = IO(new ColourUnitIO(config))

  private val step     = RegInit(ColourStep.idle)
  private val channel  = Reg(UInt(2.W))
  private val material = Reg(UInt(indices.W))
  private val cosine   = Reg(UInt(formats.cosineBits.W))

  /** Light that falls onto the surface. */
  private val incoming = Reg(Vec(3, UInt((NumberFormats.lightBits + 1).W)))
  private val lit      = Reg(Vec(3, FrameRegisters.colour))
  private val ambient  = Reg(Vec(3, FrameRegisters.colour))

  private def select(colour: Seq[UInt], channel: UInt): UInt =
    MuxLookup(channel, colour(2))(Seq(0.U -> colour(0), 1.U -> colour(1)))

  // Factors
  private val isDirect     = step === ColourStep.direct
  private val isAmbient    = step === ColourStep.ambient
  private val isLit        = step === ColourStep.lit
  private val ambientLight = io.ambient.channels.map(_.natural)
  private val directLight  = select(io.light.colour.channels.map(_.natural), channel)
  private val albedo       = select(io.materials(material).albedo.channels, channel)
  private val illumination = Mux(isAmbient, select(ambientLight, channel), select(incoming, channel))
  io.factors.valid       := isAmbient || isDirect || isLit
  io.factors.bits.wide   := Mux(isDirect, cosine, illumination).zext.pad(formats.wideBits)
  io.factors.bits.narrow := Mux(isDirect, directLight, albedo).zext.pad(formats.narrowBits)

  // The product of this cycle comes in the next one, whatever that does
  private val arrivingStep    = RegNext(Mux(io.factors.fire, step, ColourStep.idle), ColourStep.idle)
  private val arrivingChannel = RegNext(channel)
  private val product         = io.product.asUInt
  private val direct          =
    Rounding.narrow(Rounding.floor(product, config.numbers.cosineFraction), NumberFormats.lightBits)
  private val colour = Rounding.saturate(Rounding.floor(product, NumberFormats.lightFraction), NumberFormats.colourBits)
  for (i <- 0 until 3) {
    when(arrivingChannel === i.U) {
      when(arrivingStep === ColourStep.ambient)(ambient(i) := colour)
      when(arrivingStep === ColourStep.direct)(incoming(i) := ambientLight(i) +& direct)
      when(arrivingStep === ColourStep.lit)(lit(i)         := colour)
    }
  }

  // Control
  private val isLast = channel === 2.U
  when(io.factors.fire)(channel := Mux(isLast, 0.U, channel + 1.U))
  switch(step) {
    is(ColourStep.idle) {
      channel  := 0.U
      material := io.material.bits
      when(io.material.fire)(step := ColourStep.ambient)
    }
    is(ColourStep.ambient) {
      when(io.factors.fire && isLast)(step := ColourStep.cosine)
    }
    is(ColourStep.cosine) {
      cosine := io.cosine.bits
      when(io.cosine.fire)(step := ColourStep.direct)
    }
    is(ColourStep.direct) {
      when(io.factors.fire && isLast)(step := ColourStep.lit)
    }
    is(ColourStep.lit) {
      when(io.factors.fire && isLast)(step := ColourStep.done)
    }
    is(ColourStep.done) {
      when(io.colours.fire)(step := ColourStep.idle)
    }
  }

  io.material.ready       := step === ColourStep.idle
  io.cosine.ready         := step === ColourStep.cosine
  io.colours.valid        := step === ColourStep.done && arrivingStep === ColourStep.idle
  io.colours.bits.lit     := toRgb(lit)
  io.colours.bits.ambient := toRgb(ambient)

  private def toRgb(channels: Vec[UInt]): Rgb[UInt] = {
    val rgb = Wire(Rgb(FrameRegisters.colour))
    rgb.channels.zip(channels).foreach { case (to, from) => to := from }
    rgb
  }
}

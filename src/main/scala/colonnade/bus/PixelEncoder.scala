package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.Pixel

/** A pixel as it lies in memory, or the shadow ratio of a pixel that will show the photo. */
final class EncodedPixel(config: ColonnadeConfig) extends Bundle {
  val x    = UInt(config.numbers.coordinateBits.W)
  val y    = UInt(config.numbers.coordinateBits.W)
  val data = UInt(PixelWord.bits(config).W) // see [[PixelWord]]
}

/** A pixel's word: the low bytes follow the format. With an environment the highest bit says that the word is a
  * shadow ratio, red in the low bits.
  */
object PixelWord {
  def bits(config: ColonnadeConfig): Int = 8 * PixelFormat.maxBytes + (if (config.hasEnvironment) 1 else 0)

  def ofRatio(ratio: Seq[UInt]): UInt = {
    val packed = ratio(2) ## ratio(1) ## ratio(0)
    1.U(1.W) ## packed.pad(8 * PixelFormat.maxBytes)
  }

  def showsPhoto(word: UInt): Bool = if (word.getWidth > 8 * PixelFormat.maxBytes) word.head(1).asBool else false.B
}

/** Encodes pixels for the framebuffer, one per cycle, in five cycles. */
final class PixelEncoder(config: ColonnadeConfig) extends Module {
  val format = IO(Input(UInt(PixelFormat.getWidth.W)))
  val pixels = IO(Flipped(Decoupled(new Pixel(config))))
  val out    = IO(Decoupled(new EncodedPixel(config)))
  val isIdle = IO(Output(Bool()))

  /** With an environment: pixels that do not show the object become shadow ratios. */
  val composites = Option.when(config.hasEnvironment)(IO(Input(Bool())))

  private val encoded = Wire(chiselTypeOf(out))
  private val moves   = !encoded.valid || encoded.ready
  private val valids  = Seq.iterate(pixels.valid, SrgbEncoder.latency + 1)(valid => RegEnable(valid, false.B, moves))
  private val pixel   = Seq.iterate(pixels.bits, SrgbEncoder.latency + 1)(pixel => RegEnable(pixel, moves)).last
  pixels.ready := moves

  private val channels = Seq(pixels.bits.colour.r, pixels.bits.colour.g, pixels.bits.colour.b)
  private val codes    = channels.map { channel =>
    val encoder = Module(new SrgbEncoder())
    encoder.linear := channel
    encoder.enable := moves
    encoder.code
  }
  private val linear = Seq(pixel.colour.r, pixel.colour.g, pixel.colour.b).map { channel =>
    val bits: UInt = channel
    bits ## bits(NumberFormats.colourBits - 1, 2 * NumberFormats.colourBits - 16) // all ones is 1.0
  }
  private val word = PixelFormat.packed(format, codes, linear, pixel.isObject).pad(PixelWord.bits(config))

  encoded.valid     := valids.last
  encoded.bits.x    := pixel.x
  encoded.bits.y    := pixel.y
  encoded.bits.data := word
  for (ratio <- pixel.ratio) when(composites.get && !pixel.isObject) {
    encoded.bits.data := PixelWord.ofRatio(Seq(ratio.r, ratio.g, ratio.b).map(_.natural))
  }
  out :<>= TimingSlice.queue(encoded)
  isIdle := !valids.drop(1).reduce(_ || _) && !out.valid
}

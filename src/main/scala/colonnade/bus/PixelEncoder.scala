package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.common.TimingSlice
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.Pixel

import scala.collection.concurrent.TrieMap

/** Formats of a framebuffer; docs/bus-shell.md. Code 3 is illegal. */
object PixelFormat extends ChiselEnum {
  val xrgb8888, rgb565, linear16 = Value

  val maxBytes: Int = 8

  /** The base-2 logarithm of a pixel's bytes. */
  def bytesLog(format: UInt): UInt =
    Mux(format === rgb565.litValue.U, 1.U, Mux(format === linear16.litValue.U, 3.U, 2.U(2.W)))

  /** A pixel in a format: its sRGB codes, its linear channels in 16 bits, and whether it shows the object. */
  def packed(format: UInt, codes: Seq[UInt], linear: Seq[UInt], isObject: Bool): UInt = {
    val Seq(r, g, b) = codes
    val xrgb         = 255.U(8.W) ## r ## g ## b
    val rgb565       = r(7, 3) ## g(7, 2) ## b(7, 3)
    val linear16     = Fill(16, isObject) ## linear(2) ## linear(1) ## linear(0)
    MuxLookup(format, xrgb)(Seq(this.rgb565.litValue.U -> rgb565, this.linear16.litValue.U -> linear16))
      .pad(8 * maxBytes)
  }

  def isLegal(format: UInt): Bool = format <= linear16.litValue.U
}

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

/** Encodes a linear channel as 8 bits of sRGB (IEC 61966-2-1), rounded to the nearest code.
  *
  * A search by halves in the table of the least linear values of all codes, two bits of the code in each of four cycles
  * in which `enable` lets values move.
  *
  * @param linearBits width of a linear value; all ones is 1.0
  */
final class SrgbEncoder(linearBits: Int = NumberFormats.colourBits) extends Module {
  val linear = IO(Input(UInt(linearBits.W)))
  val enable = IO(Input(Bool()))
  val code   = IO(Output(UInt(SrgbEncoder.codeBits.W)))

  /** The code's next bit, below the bits that are known. */
  private def next(known: Option[UInt], value: UInt): UInt = {
    val bit    = SrgbEncoder.codeBits - 1 - known.fold(0)(_.getWidth)
    val tables =
      VecInit(SrgbEncoder.leastLinear(linearBits).grouped(2 << bit).map(_(1 << bit).U(value.getWidth.W)).toSeq)
    val least = known.fold(tables.head)(tables(_))
    known.fold((value >= least).asUInt)(Cat(_, value >= least))
  }
  private def part(known: Option[UInt], value: UInt): UInt =
    (0 until SrgbEncoder.codeBits / SrgbEncoder.latency).foldLeft(known)((bits, _) => Some(next(bits, value))).get

  private val (_, found) = (0 until SrgbEncoder.latency).foldLeft((linear, Option.empty[UInt])) {
    case ((value, known), _) =>
      (RegEnable(value, enable), Some(RegEnable(part(known, value), enable)))
  }
  code := found.get
}

object SrgbEncoder {
  val codeBits: Int = 8
  val latency:  Int = 4

  /** The code of a linear value. */
  def apply(linear: Int, linearBits: Int = NumberFormats.colourBits): Int = {
    val value   = linear.toDouble / ((1 << linearBits) - 1)
    val encoded = if (value <= 0.0031308) 12.92 * value else 1.055 * math.pow(value, 1 / 2.4) - 0.055
    math.rint(255 * encoded).toInt
  }

  /** The linear value of a code, rounded to the nearest. */
  def decoded(code: Int, linearBits: Int): Int = {
    val value  = code / 255.0
    val linear = if (value <= 0.04045) value / 12.92 else math.pow((value + 0.055) / 1.055, 2.4)
    math.rint(linear * ((1 << linearBits) - 1)).toInt
  }

  private val tables = TrieMap.empty[Int, IndexedSeq[Int]]

  /** The least linear value of each code, or of a higher one. */
  private def leastLinear(linearBits: Int): IndexedSeq[Int] = tables.getOrElseUpdate(
    linearBits, {
      val codes = (0 until 1 << linearBits).map(apply(_, linearBits))
      (0 until 1 << codeBits).map(code => codes.indexWhere(_ >= code))
    }
  )
}

package colonnade.bus

import chisel3._
import chisel3.util._
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.formats.Pixel

/** A pixel as it lies in memory. */
final class EncodedPixel(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)

  /** The low bytes are those of the format. */
  val data = UInt((8 * PixelFormat.maxBytes).W)
}

/** Encodes pixels for the framebuffer, one per cycle, in two cycles. */
final class PixelEncoder(config: ColonnadeConfig) extends Module {
  val format = IO(Input(UInt(PixelFormat.getWidth.W)))
  val pixels = IO(Flipped(Decoupled(new Pixel(config))))
  val out    = IO(Decoupled(new EncodedPixel(config)))
  val isIdle = IO(Output(Bool()))

  private val moves  = !out.valid || out.ready
  private val valids = Seq.iterate(pixels.valid, SrgbEncoder.latency + 1)(valid => RegEnable(valid, false.B, moves))
  private val pixel  = Seq.iterate(pixels.bits, SrgbEncoder.latency + 1)(pixel => RegEnable(pixel, moves)).last
  pixels.ready := moves

  private val channels = Seq(pixels.bits.colour.r, pixels.bits.colour.g, pixels.bits.colour.b)
  private val codes    = channels.map { channel =>
    val encoder = Module(new SrgbEncoder)
    encoder.linear := channel
    encoder.enable := moves
    encoder.code
  }
  private val Seq(r, g, b) = codes
  private val linear       = Seq(pixel.colour.r, pixel.colour.g, pixel.colour.b).map { channel =>
    val bits: UInt = channel
    bits ## bits(NumberFormats.colourBits - 1, 2 * NumberFormats.colourBits - 16) // all ones is 1.0
  }
  private val xrgb     = 255.U(8.W) ## r ## g ## b
  private val rgb565   = r(7, 3) ## g(7, 2) ## b(7, 3)
  private val linear16 = Fill(16, pixel.isObject) ## linear(2) ## linear(1) ## linear(0)

  out.valid     := valids.last
  out.bits.x    := pixel.x
  out.bits.y    := pixel.y
  out.bits.data := MuxLookup(format, xrgb)(
    Seq(PixelFormat.rgb565.litValue.U -> rgb565, PixelFormat.linear16.litValue.U -> linear16)
  )
  isIdle := !valids.drop(1).reduce(_ || _)
}

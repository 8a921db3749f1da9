package colonnade.shading

import chisel3._
import chisel3.util.RegEnable
import chisel3.util.random.LFSR
import colonnade.config.ColonnadeConfig

/** A shader, with a texture whose texels are made of their position and come after one to eight cycles. */
final class ShaderHarness(config: ColonnadeConfig) extends Module {
  val io = IO(new ShaderIO(config))

  private val shader = Shader(config)
  io <> shader

  for ((port, unused) <- shader.texture.zip(io.texture)) {
    val random    = LFSR(8)
    val isWaiting = RegInit(false.B)
    val pixel     = RegEnable(port.req.bits, port.req.fire)
    val texel     = port.resp.bits.colour
    unused.req.valid         := false.B
    unused.req.bits          := DontCare
    port.req.ready           := random(1)
    port.resp.valid          := isWaiting && random(2, 0) === 0.U
    port.resp.bits.isIllegal := false.B
    texel.r                  := pixel.x
    texel.g                  := pixel.y
    texel.b                  := pixel.x ^ pixel.y
    when(port.req.fire) { isWaiting := true.B }.elsewhen(port.resp.valid) { isWaiting := false.B }
    assert(!(port.req.valid && isWaiting), "one request at a time")
  }
}

object ShaderHarness {

  /** The texel at a position, whose red and green have three fraction bits. */
  def texel(position: Seq[BigInt]): Seq[BigInt] = {
    val Seq(x, y) = position.take(2).map(_ >> 3)
    Seq(x, y, x ^ y)
  }
}

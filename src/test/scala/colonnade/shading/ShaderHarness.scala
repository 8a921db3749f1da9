package colonnade.shading

import chisel3._
import chisel3.util.Queue
import chisel3.util.random.LFSR
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig

/** A shader, with a texture whose texels are made of their position and come in order, after a random time. */
final class ShaderHarness(config: ColonnadeConfig) extends Module {
  val io = IO(new ShaderIO(config))

  private val unit   = Module(Shader(config))
  private val shader = unit.io
  io <> shader

  /** The unit that the factory has chosen. */
  val leaf: String = unit.desiredName

  for ((port, unused) <- shader.texture.zip(io.texture)) {
    val random = LFSR(8)
    val asked  = Module(new Queue(chiselTypeOf(port.req.bits), 4)).io
    val pixel  = asked.deq.bits
    val texel  = port.resp.bits.colour
    unused.req.valid         := false.B
    unused.req.bits          := DontCare
    asked.enq.valid          := port.req.valid && random(1)
    asked.enq.bits           := port.req.bits
    port.req.ready           := asked.enq.ready && random(1)
    asked.deq.ready          := random(2, 0) === 0.U
    port.resp.valid          := asked.deq.fire
    port.resp.bits.isIllegal := false.B
    texel.r                  := pixel.x
    texel.g                  := pixel.y
    texel.b                  := pixel.x ^ pixel.y
  }
}

object ShaderHarness {

  /** The texel at a position, whose red and green have three fraction bits. */
  def texel(position: Seq[BigInt]): Seq[BigInt] = {
    val Seq(x, y) = position.take(2).map(_ >> 3)
    Seq(x, y, x ^ y)
  }
}

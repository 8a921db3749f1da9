package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Pipe, Queue, Valid}
import colonnade.config.{PathConfig, TextureLayout}
import colonnade.formats.{AlbedoEntry, Load}
import colonnade.shading.TexturePort

final class TextureMemoryIO(config: PathConfig) extends Bundle {
  val load = Flipped(Valid(new Load(config))) // only while no request is in flight

  val port = Flipped(new TexturePort(config))
}

/** A column's copy of the textures: one atlas as a two-level map: docs/textures.md.
  *
  * One request a cycle. Latency: that of [[TwoLevelMap]] and two cycles. A reset drops requests in flight, but keeps the
  * atlas.
  */
final class TextureMemory(config: PathConfig) extends Module {
  val io = IO(new TextureMemoryIO(config))

  private val map =
    Module(new TwoLevelMap(config, TextureLayout.of(config), "texture", new AlbedoEntry, tagBits = 0)).io
  private val req = Wire(Decoupled(chiselTypeOf(map.pixels.req.bits)))
  req.valid          := io.port.req.valid
  req.bits.tag       := 0.U
  req.bits.content.x := io.port.req.bits.x
  req.bits.content.y := io.port.req.bits.y
  io.port.req.ready  := req.ready
  map.pixels.req :<>= Queue(req)
  map.load := io.load

  private val resp = Pipe(map.pixels.resp)
  io.port.resp.valid          := resp.valid
  io.port.resp.bits.colour    := resp.bits.content
  io.port.resp.bits.isIllegal := resp.bits.isIllegal
}

package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{ColonnadeConfig, PathConfig, TextureLayout}
import colonnade.formats.{AlbedoEntry, Load}
import colonnade.shading.TexturePort

final class TextureMemoryIO(config: ColonnadeConfig, columns: Int) extends Bundle {
  val load  = Flipped(Valid(new Load(config))) // only while no request is in flight
  val ports = Vec(columns, Flipped(new TexturePort(PathConfig(config))))
}

/** The textures of some columns: one atlas as a two-level map: docs/textures.md.
  *
  * One request a cycle, of the columns by round-robin. Latency: [[TwoLevelMap]]'s and two cycles. A reset drops
  * requests in flight, but keeps the atlas.
  */
final class TextureMemory(config: ColonnadeConfig, columns: Int) extends Module {
  val io = IO(new TextureMemoryIO(config, columns))

  private val layout  = TextureLayout.of(config)
  private val tagBits = AttributeArbiter.tagBits(columns)
  private val map     = Module(new TwoLevelMap(config, layout, "texture", new AlbedoEntry, tagBits)).io
  private val arbiter = Module(new AttributeArbiter(new MapPixel(layout), new AlbedoEntry, columns, tagBits = 0)).io
  map.load := io.load
  map.pixels :<>= arbiter.joined
  for ((port, requester) <- io.ports.zip(arbiter.requesters)) {
    requester.req.valid          := port.req.valid
    requester.req.bits.tag       := 0.U
    requester.req.bits.content.x := port.req.bits.x
    requester.req.bits.content.y := port.req.bits.y
    port.req.ready               := requester.req.ready
    port.resp.valid              := requester.resp.valid
    port.resp.bits.colour        := requester.resp.bits.content
    port.resp.bits.isIllegal     := requester.resp.bits.isIllegal
  }
}

object TextureMemory {

  /** Columns that share the textures, at most: a column reads a texel in three cycles. */
  val columns: Int = 4
}

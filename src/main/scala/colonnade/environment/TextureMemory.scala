package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{ColonnadeConfig, TextureLayout}
import colonnade.formats.{AlbedoEntry, Load}
import colonnade.shading.TexturePort

/** Ports of [[TextureMemory]]. */
final class TextureMemoryIO(config: ColonnadeConfig) extends Bundle {

  /** Only while no request is in flight. */
  val load = Flipped(Valid(new Load(config)))

  /** One for each render unit. */
  val ports = Vec(config.array.rows, Flipped(new TexturePort(config)))
}

/** A column's copy of the textures: one atlas as a two-level map, with a port for each render unit: docs/textures.md.
  *
  * One request a cycle, by round-robin. Latency: that of [[TwoLevelMap]] and two cycles. A reset drops requests in flight,
  * but keeps the atlas.
  */
final class TextureMemory(config: ColonnadeConfig) extends Module {
  val io = IO(new TextureMemoryIO(config))

  private val rows    = config.array.rows
  private val layout  = TextureLayout.of(config)
  private val arbiter = Module(new AttributeArbiter(new MapPixel(layout), new AlbedoEntry, rows, tagBits = 0))
  private val map     =
    Module(new TwoLevelMap(config, layout, "texture", new AlbedoEntry, AttributeArbiter.tagBits(rows, tagBits = 0)))

  for ((port, requester) <- io.ports.zip(arbiter.io.requesters)) {
    requester.req.valid          := port.req.valid
    requester.req.bits.tag       := 0.U
    requester.req.bits.content.x := port.req.bits.x
    requester.req.bits.content.y := port.req.bits.y
    port.req.ready               := requester.req.ready
    port.resp.valid              := requester.resp.valid
    port.resp.bits.colour        := requester.resp.bits.content
    port.resp.bits.isIllegal     := requester.resp.bits.isIllegal
  }
  map.io.pixels <> arbiter.io.joined
  map.io.load := io.load
}

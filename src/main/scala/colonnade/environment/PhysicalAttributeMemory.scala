package colonnade.environment

import chisel3._
import chisel3.util.Valid
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AlbedoEntry, AttributeEvents, Load, NormalEntry}

final class PhysicalAttributeMemoryIO(config: ColonnadeConfig, requesters: Int, tagBits: Int) extends Bundle {
  val load   = Flipped(Valid(new Load(config))) // only while no request is in flight
  val ports  = Vec(requesters, Flipped(new AttributePort(AttributeLayout.of(config), tagBits)))
  val events = Output(new AttributeEvents)
}

/** The environment's maps, with a port for each requester: the marches and the direct view of a column, or the columns
  * that share one memory. Each of the four channels accepts one request a cycle, see [[AttributeConcentrator]]. A reset
  * drops requests in flight, but keeps the maps.
  *
  * Latency: the map's and two cycles.
  */
final class PhysicalAttributeMemory(
    config:     ColonnadeConfig,
    requesters: Int,
    tagBits:    Int,
    ofColumn:   Boolean = false
) extends Module {
  val io = IO(new PhysicalAttributeMemoryIO(config, requesters, tagBits))

  private val joinedBits = AttributeArbiter.tagBits(requesters, tagBits)
  private val joined     = Module(new AttributeConcentrator(config, requesters, tagBits, ofColumn))
  private val albedo     = Module(AttributeMap(config, "albedo", new AlbedoEntry, joinedBits))
  private val normals    = Module(AttributeMap(config, "normals", new NormalEntry, joinedBits))
  private val planes     = Module(new PlaneMap(config, joinedBits))

  joined.io.ports <> io.ports
  albedo.io.pixels <> joined.io.joined.albedo
  normals.io.pixels <> joined.io.joined.normals
  planes.io.cells <> joined.io.joined.cells
  planes.io.planes <> joined.io.joined.planes

  albedo.io.load  := io.load
  normals.io.load := io.load
  planes.io.load  := io.load

  io.events := joined.io.joined.events
}

package colonnade.environment

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig, TileGrid}
import colonnade.formats.{AlbedoEntry, AttributeEvents, BoundingPlaneEntry, NormalEntry}

/** A request with a tag, which its response carries as well. */
final class TaggedRequest[T <: Data](private val kind: T, tagBits: Int) extends Bundle {
  val content = kind.cloneType
  val tag     = UInt(tagBits.W)
}

/** A response with the tag of its request. */
final class TaggedResponse[T <: Data](private val kind: T, tagBits: Int) extends Bundle {
  val isIllegal = Bool() // a word beyond the map's heap was read as 0
  val content   = kind.cloneType
  val tag       = UInt(tagBits.W)
}

/** Requests to a map and its responses, from the requester's side. Responses come in the order of the requests, at any
  * time after them, and cannot be stalled.
  */
final class AttributeChannel[Q <: Data, R <: Data](private val request: Q, private val response: R, tagBits: Int)
    extends Bundle {
  val req  = Decoupled(new TaggedRequest(request, tagBits))
  val resp = Flipped(Valid(new TaggedResponse(response, tagBits)))
}

/** A pixel of the maps. A requester must keep it inside them. */
final class MapPixel(layout: TileGrid) extends Bundle {
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)
}

/** Requests the planes of a tile or a cell. */
final class CellRequest(layout: AttributeLayout) extends Bundle {
  val pixel     = new MapPixel(layout)
  val wholeTile = Bool() // all planes of the pixel's tile; otherwise the plane of its cell
}

/** The planes of a tile, or the plane of a cell. */
final class CellResponse(layout: AttributeLayout) extends Bundle {
  val cellLog = UInt(CellResponse.cellLogBits.W)   // log2 of the edge of the tile's cells in pixels; a flat tile is one
  val count   = UInt(3.W)                          // planes: 1, 2 or 4 of a tile, 1 of a cell
  val ids     = Vec(4, UInt(layout.planeIdBits.W)) // the planes; 0 beyond the count
}

object CellResponse {
  val cellLogBits: Int = 3 // a tile's edge is 2^5 at most
}

/** Requests an entry of the plane table, or a bounding plane. */
final class PlaneRequest(layout: AttributeLayout) extends Bundle {
  val isBoundingPlane = Bool()
  val index           = UInt(layout.tableIndexBits.W)
}

/** All channels of a requester; they are independent of each other. Albedo and normal of a plane's response are valid
  * for bounding planes only.
  *
  * @param tagBits bits of a tag; none of a single requester
  */
final class AttributePort(layout: AttributeLayout, tagBits: Int = 0) extends Bundle {
  val albedo  = new AttributeChannel(new MapPixel(layout), new AlbedoEntry, tagBits)
  val normals = new AttributeChannel(new MapPixel(layout), new NormalEntry, tagBits)
  val cells   = new AttributeChannel(new CellRequest(layout), new CellResponse(layout), tagBits)
  val planes  = new AttributeChannel(new PlaneRequest(layout), new BoundingPlaneEntry, tagBits)

  /** Requests accepted in this cycle. */
  def events: AttributeEvents = {
    val events = Wire(new AttributeEvents)
    events.albedoReads := albedo.req.fire
    events.normalReads := normals.req.fire
    events.cellReads   := cells.req.fire
    events.planeReads  := planes.req.fire
    events
  }

  /** Ties off a port without a requester. */
  def tieOff(): Unit = {
    Seq(albedo, normals, cells, planes).foreach { channel =>
      channel.req.valid := false.B
      channel.req.bits  := DontCare
    }
  }
}

object AttributePort {

  /** The port of a column, for all of its requesters. */
  def ofColumn(config: ColonnadeConfig): AttributePort =
    new AttributePort(AttributeLayout.of(config), AttributeArbiter.tagBits(config.mapRequesters))
}

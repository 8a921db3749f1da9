package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.PartConfig
import colonnade.formats.{NodeRecord, RecordBroadcast, RecordFormats, RecordRequest, SceneMap}
import colonnade.ray.BoxRay

/** The kind of a record; each kind has one unit that takes it: box unit, triangle unit, shader. */
object RecordKind extends ChiselEnum {
  val node, leaf, colours = Value
}

/** A context that needs a record. */
final class FetchRequest(config: PartConfig) extends Bundle {
  val context = Context(config)
  val kind    = RecordKind()
  val address = UInt(RecordFormats.idBits(config.device).W)
}

/** A record, and the context that requested it. */
final class FetchResponse(config: PartConfig) extends Bundle {
  val context = Context(config)
  val kind    = RecordKind()
  val address = UInt(RecordFormats.addressBits(config.device).W)
  val record  = new RecordFormats(config.device).record
}

/** A request whose address lies outside the section of its kind; it gets no record. */
final class FetchError(config: PartConfig) extends Bundle {
  val context = Context(config)
  val kind    = RecordKind()
}

/** A node, and the ray to test against its children. */
final class NodeCandidate(config: PartConfig) extends Bundle {
  val context = Context(config)
  val address = UInt(RecordFormats.addressBits(config.device).W)
  val node    = new NodeRecord(config.device)
  val ray     = new BoxRay(config.numbers)
}

/** Events of [[FetchStage]]; names as in `Counters`. */
final class FetchEvents(config: PartConfig) extends Bundle {
  private def contextCount = UInt(log2Ceil(config.contexts + 1).W)

  val waitRecord    = contextCount
  val waitUnit      = contextCount
  val snoopHits     = contextCount
  val illegalRecord = Bool()
}

final class RecordFetchIO(config: PartConfig) extends Bundle {
  private def contextCount = UInt(log2Ceil(config.contexts + 1).W)

  /** Invalidates all buffers: the memory may have changed. */
  val start = Input(Bool())
  val row   = Input(UInt(log2Ceil(config.device.recordRequesters.max(2)).W))
  val scene = Input(new SceneMap(config.device))

  /** A context has at most one request outstanding. */
  val fetches    = Flipped(Vec(RecordFetch.ports, Valid(new FetchRequest(config))))
  val requests   = Decoupled(new RecordRequest(config.device))
  val broadcasts = Flipped(Vec(config.device.columnBvhMemory.banks, Valid(new RecordBroadcast(config.device))))

  /** By [[RecordKind]]: the unit accepts a record in the next cycle. It must keep to this. */
  val readyNext = Input(Vec(RecordKind.all.size, Bool()))

  /** A record waits for a triangle unit. */
  val waitsForTriangles = Output(Bool())

  /** The context that gets a response in the next cycle, and whether its record is a node. */
  val grantNext      = Output(Valid(Context(config)))
  val grantsNodeNext = Output(Bool())
  val response       = Output(Valid(new FetchResponse(config)))
  val error          = Output(Valid(new FetchError(config)))

  /** Contexts that wait for their record, and contexts whose record waits for its unit. */
  val stalledContexts = Output(contextCount)
  val readyContexts   = Output(contextCount)

  /** Contexts that get a record which another request has read. */
  val snoopHits = Output(contextCount)
}

package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, Pipe, Queue, Valid}
import colonnade.common.RoundRobin
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AlbedoEntry, AttributeEvents, AttributeMemories, AttributeMemory, Load, NormalEntry}

final class ColumnEnvironmentIO(config: ColonnadeConfig) extends Bundle {
  val load = Flipped(Valid(new Load(config))) // only while no request is in flight

  /** One for each march, and one for the pipeline of directly seen pixels. */
  val ports = Vec(config.mapRequesters, Flipped(new AttributePort(AttributeLayout.of(config))))

  /** To the maps that some columns share, if the configuration says so. */
  val shared = Option.when(config.columnsPerCopy > 1)(AttributePort.ofColumn(config))
  val events = Output(new AttributeEvents)
}

/** A column's access to the environment's maps: its own copy, or a port to one that some columns share. */
final class ColumnEnvironment(config: ColonnadeConfig) extends Module {
  val io = IO(new ColumnEnvironmentIO(config))

  io.shared match {
    case Some(shared) =>
      val units = Module(new AttributeConcentrator(config, config.mapRequesters, tagBits = 0, ofColumn = true))
      units.io.ports <> io.ports
      shared <> units.io.joined
      io.events := shared.events
    case None =>
      val maps = Module(new PhysicalAttributeMemory(config, config.mapRequesters, tagBits = 0, ofColumn = true))
      maps.io.ports <> io.ports
      maps.io.load := io.load
      io.events    := maps.io.events
  }
}

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

final class AttributeStoreIO(config: ColonnadeConfig, memory: AttributeMemory) extends Bundle {
  val load = Flipped(Valid(new Load(config))) // only while no frame runs
  val read = Flipped(Valid(UInt(log2Ceil(memory.depth).W)))
  val word = Output(UInt(memory.bits.W))      // the word that was read in the cycle before
}

/** One of the `AttributeMemories`. It has a single port, since reads and loads exclude each other. A load beyond its
  * depth is ignored.
  */
final class AttributeStore(config: ColonnadeConfig, memory: AttributeMemory) extends Module {
  val io = IO(new AttributeStoreIO(config, memory))

  private val words  = SyncReadMem(memory.depth, UInt(memory.bits.W))
  private val loads  = io.load.valid && io.load.bits.target === memory.target.U
  private val writes = loads && io.load.bits.address < memory.depth.U
  assert(!(loads && io.read.valid), "a load during a read")

  private val target  = io.load.bits.address(log2Ceil(memory.depth) - 1, 0)
  private val address = Mux(loads, target, io.read.bits)
  io.word := words.readWrite(address, io.load.bits.record(memory.bits - 1, 0), writes || io.read.valid, writes)
}

/** A store that tiles point into, with arbitrary pointers. A word beyond its end is 0.
  *
  * @param name of the memory
  */
final class AttributeHeap(config: ColonnadeConfig, name: String, load: Valid[Load]) {
  private val store    = AttributeStore(config, name, load)
  private val depth    = AttributeStore.memory(config, name).depth
  private val isBeyond = Wire(Bool())

  /** The word that was read in the cycle before, and whether it lies beyond the end, which makes its tile illegal. */
  val isIllegal: Bool = RegNext(isBeyond, false.B)
  val word:      UInt = Mux(isIllegal, 0.U, store.word)

  /** Connects the read port; call it once. */
  def read(valid: Bool, address: UInt): Unit = {
    store.read.valid := valid
    store.read.bits  := address.pad(store.read.bits.getWidth)(store.read.bits.getWidth - 1, 0)
    isBeyond         := valid && address >= depth.U
  }
}

object AttributeStore {

  /** The memory of the given name. */
  def memory(config: ColonnadeConfig, name: String): AttributeMemory =
    AttributeMemories(config).find(_.name == name).getOrElse(throw new NoSuchElementException(name))

  /** A store for the memory of the given name. */
  def apply(config: ColonnadeConfig, name: String, load: Valid[Load]): AttributeStoreIO = {
    val store = Module(new AttributeStore(config, memory(config, name)))
    store.suggestName(name.replace('.', '_'))
    store.io.load := load
    store.io
  }
}

final class AttributeArbiterIO[Q <: Data, R <: Data](request: Q, response: R, count: Int, tagBits: Int) extends Bundle {
  val requesters = Vec(count, Flipped(new AttributeChannel(request, response, tagBits)))

  /** A tag here is a requester's number above its own tag. */
  val joined = new AttributeChannel(request, response, AttributeArbiter.tagBits(count, tagBits))
}

/** Joins the channels of several requesters by round-robin, or the last one first. A response goes to all of them and
  * is valid for the requester that its tag names.
  *
  * One request a cycle. Requests and responses pass one register each, so that arbiters can form trees of any size.
  *
  * @param lastFirst the last requester goes before the others; it leaves cycles to them
  */
final class AttributeArbiter[Q <: Data, R <: Data](
    request:   Q,
    response:  R,
    count:     Int,
    tagBits:   Int,
    lastFirst: Boolean = false
) extends Module {
  val io = IO(new AttributeArbiterIO(request, response, count, tagBits))

  // Grant a requester
  private val reqs    = io.requesters.map(_.req)
  private val others  = if (lastFirst) reqs.init else reqs
  private val isFirst = lastFirst.B && reqs.last.valid
  private val arbiter = Module(new RoundRobin(others.size))
  private val granted = Wire(Decoupled(chiselTypeOf(io.joined.req.bits)))
  private val grant   = arbiter.io.grant.asBools.map(_ && !isFirst) ++ Option.when(lastFirst)(isFirst)
  private val bits    = Mux1H(grant, reqs.map(_.bits))
  arbiter.io.requests  := VecInit(others.map(_.valid)).asUInt
  arbiter.io.isTaken   := granted.fire && !isFirst
  granted.valid        := reqs.map(_.valid).reduce(_ || _)
  granted.bits.content := bits.content
  granted.bits.tag     := (if (count == 1) bits.tag else OHToUInt(grant) ## bits.tag)
  io.joined.req <> Queue(granted)
  for ((req, isGranted) <- reqs.zip(grant)) req.ready := isGranted && granted.ready

  // Broadcast the response
  private val broadcast = Pipe(io.joined.resp)
  for ((requester, number) <- io.requesters.zipWithIndex) {
    requester.resp.valid := broadcast.valid && broadcast.bits.tag >> tagBits === number.U
    requester.resp.bits  := broadcast.bits
  }
}

object AttributeArbiter {

  /** Bits of the joined channel's tag. */
  def tagBits(requesters: Int, tagBits: Int = 0): Int = tagBits + log2Ceil(requesters)
}

final class AttributeConcentratorIO(config: ColonnadeConfig, requesters: Int, tagBits: Int) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val ports  = Vec(requesters, Flipped(new AttributePort(layout, tagBits)))
  val joined = new AttributePort(layout, AttributeArbiter.tagBits(requesters, tagBits))
}

/** Joins several ports into one, with an [[AttributeArbiter]] for each channel. Of a column's ports the last one goes
  * first, the pipeline of directly seen pixels: it asks in every fourth cycle at most, and all pixels wait for it.
  */
final class AttributeConcentrator(config: ColonnadeConfig, requesters: Int, tagBits: Int, ofColumn: Boolean)
    extends Module {
  val io = IO(new AttributeConcentratorIO(config, requesters, tagBits))

  join(_.albedo)
  join(_.normals)
  join(_.cells)
  join(_.planes)

  private def join[Q <: Data, R <: Data](channel: AttributePort => AttributeChannel[Q, R]): Unit = {
    val joined  = channel(io.joined)
    val arbiter = Module(
      new AttributeArbiter(
        chiselTypeOf(joined.req.bits.content),
        chiselTypeOf(joined.resp.bits.content),
        requesters,
        tagBits,
        lastFirst = ofColumn
      )
    )
    arbiter.io.requesters.zip(io.ports).foreach { case (requester, port) => requester <> channel(port) }
    joined <> arbiter.io.joined
  }
}

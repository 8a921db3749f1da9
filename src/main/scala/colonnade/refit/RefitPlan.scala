package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.axi.Axi
import colonnade.config.ColonnadeConfig
import colonnade.formats.{NodeRecord, Octahedral, RecordFormats, Vec3}

/** Numbers of a plan, which driver/src/colonnade_mesh_plan.c writes: docs/bus-shell.md. */
object RefitPlan {
  val entryBits:     Int = 128 // of an entry, and of a vertex
  val lineBytes:     Int = 64  // that are read at once
  val lineEntries:   Int = lineBytes * 8 / entryBits
  val ringLines:     Int = 128 // lines of vertices that are held or requested
  val linesInFlight: Int = 32  // requested ones
  val boxes:         Int = 128 // that wait for their node
  val countBits:     Int = 24  // of entries, and of lines
}

/** The kinds of entries. */
object RefitKind {
  def lines: UInt    = 0.U(2.W)
  def triangle: UInt = 1.U(2.W)
  def pair: UInt     = 2.U(2.W)
  def node: UInt     = 3.U(2.W)
}

/** An entry of a plan: lines of vertices to read, a leaf, or a node whose children are before it. */
final class RefitEntry(config: ColonnadeConfig) extends Bundle {
  val words = Vec(3, UInt(32.W))
  val head  = UInt(32.W)

  private def bits = RecordFormats.addressBits(config)

  def kind: UInt = head(1, 0)

  /** The record, from the root on. */
  def address: UInt = head(bits + 1, 2)

  /** Of lines: their number, at most 3, and each of them. */
  def count: UInt             = head(3, 2)
  def line(index: UInt): UInt = words(index)(RefitPlan.countBits - 1, 0)

  /** Of a leaf: the slot of each vertex in the ring. */
  def slot(index: UInt): UInt =
    VecInit(words(0)(15, 0), words(0)(31, 16), words(1)(15, 0), words(1)(31, 16))(index)(RingSlot.bits - 1, 0)
  def material: UInt = words(2)(7, 0)
  def isClear: Bool  = words(2)(8)

  /** Of a node: its first child, from the root on, and numbers of children. */
  def first: UInt    = words(0)(bits - 1, 0)
  def leaves: UInt   = words(1)(NodeRecord.countBits - 1, 0)
  def nodes: UInt    = words(1)(2 * NodeRecord.countBits - 1, NodeRecord.countBits)
  def children: UInt = leaves +& nodes
}

/** A vertex in the ring. */
object RingSlot {
  val bits: Int = log2Ceil(RefitPlan.ringLines * RefitPlan.lineEntries)
}

/** A vertex of a pose. */
final class RefitVertex(config: ColonnadeConfig) extends Bundle {
  val normal   = Octahedral.code
  val position = Vec3(UInt(config.geometry.vertexBits.W))
}

object RefitVertex {

  /** From its four words: three of the position, and one with both numbers of the normal. */
  def apply(config: ColonnadeConfig, words: UInt): RefitVertex = {
    val vertex = Wire(new RefitVertex(config))
    val low    = 96
    vertex.normal.u := words(low + Octahedral.bits - 1, low).asSInt
    vertex.normal.v := words(low + 16 + Octahedral.bits - 1, low + 16).asSInt
    vertex.position.axes.zipWithIndex.foreach { case (axis, i) => axis := words >> (32 * i) }
    vertex
  }
}

/** Bounds, with what `ceil(high / 2^e)` needs: one less than the high ones, from -1 on. */
final class RefitBox(config: ColonnadeConfig) extends Bundle {
  val below = Vec3(SInt((config.geometry.vertexBits + 1).W))
  val low   = Vec3(UInt(config.geometry.vertexBits.W))

  /** The bounds of both. */
  def widened(other: RefitBox): RefitBox = {
    val box = Wire(chiselTypeOf(this))
    box.low   := Vec3.of(low.axes.zip(other.low.axes).map { case (a, b) => Mux(a < b, a, b) })
    box.below := Vec3.of(below.axes.zip(other.below.axes).map { case (a, b) => Mux(a > b, a, b) })
    box
  }
}

/** A record with its address, from the root on. */
final class RefitRecord(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
  val record  = new RecordFormats(config).record
}

/** What a refit reads and writes; constant while it runs. */
final class RefitSettings(config: ColonnadeConfig) extends Bundle {

  /** Addresses of the plan and of the vertices, multiples of [[RefitPlan.lineBytes]], and of the root's record. */
  val plan     = UInt(Axi.addressBits.W)
  val vertices = UInt(Axi.addressBits.W)
  val records  = UInt(Axi.addressBits.W)

  /** How many of them there are: entries, lines of vertices, records. */
  val entries = UInt(RefitPlan.countBits.W)
  val lines   = UInt(RefitPlan.countBits.W)
  val count   = UInt(RefitPlan.countBits.W)

  val root = UInt(RecordFormats.addressBits(config).W) // the root's address in the scene
}

/** Why the records of a refit are wrong, bit 0 last. */
final class RefitErrors extends Bundle {
  val plan      = Bool() // it names lines, records or boxes that are not there; nothing is written outside the records
  val response  = Bool() // an access was answered by an error
  val alignment = Bool() // an address is no multiple of a line, or of a record: nothing is written
}

/** What a refit has found: bounds of the mesh, and pairs that have become flat. */
final class RefitResult(config: ColonnadeConfig) extends Bundle {
  val low       = Vec3(UInt(config.geometry.vertexBits.W))
  val high      = Vec3(UInt(config.geometry.vertexBits.W))
  val flatPairs = UInt(RefitPlan.countBits.W)
}

final class PlanReaderIO(config: ColonnadeConfig) extends Bundle {
  val start    = Input(Bool()) // a pulse, while idle
  val settings = Input(new RefitSettings(config))

  /** To [[RefitReader]]. */
  val lines = Vec(2, Decoupled(UInt((settings.plan.getWidth - log2Ceil(RefitPlan.lineBytes)).W)))
  val data  = Flipped(Valid(UInt(RefitPlan.entryBits.W))) // of the plan

  /** All entries; entries of lines after these have been requested. */
  val entries = Decoupled(new RefitEntry(config))

  /** Lines of vertices that no entry waits for any more. */
  val retired = Input(UInt(2.W))

  val isIdle  = Output(Bool())
  val isError = Output(Bool()) // a pulse: a line is not there, and another one is read
}

/** Reads the plan ahead, and requests the lines of vertices that it names. At most [[RefitPlan.linesInFlight]] of them
  * are on their way.
  */
final class PlanReader(config: ColonnadeConfig) extends Module {
  val io = IO(new PlanReaderIO(config))

  // Lines of the plan, each with space in the queue
  private val unread = RegInit(0.U(RefitPlan.countBits.W)) // entries without a request
  private val next   = Reg(chiselTypeOf(io.lines(0).bits))
  private val taken  = RegInit(0.U(log2Ceil(PlanReader.depth + 1).W))
  private val left   = RegInit(0.U(RefitPlan.countBits.W)) // entries that have not left
  private val queue  = Module(new Queue(new RefitEntry(config), PlanReader.depth, useSyncReadMem = true))
  private val plan   = io.lines(0)
  plan.valid := unread =/= 0.U && taken <= (PlanReader.depth - RefitPlan.lineEntries).U
  plan.bits  := next
  when(plan.fire) {
    next   := next + 1.U
    unread := Mux(unread > RefitPlan.lineEntries.U, unread - RefitPlan.lineEntries.U, 0.U)
  }
  taken              := taken + (plan.fire ## 0.U(2.W)) - queue.io.deq.fire
  queue.io.enq.valid := io.data.valid
  queue.io.enq.bits  := io.data.bits.asTypeOf(queue.io.enq.bits)

  // Lines of vertices, one a cycle; then their entry leaves
  private val ahead    = Module(new Queue(new RefitEntry(config), PlanReader.depth, useSyncReadMem = true))
  private val entry    = queue.io.deq.bits
  private val index    = RegInit(0.U(2.W))
  private val inFlight = RegInit(0.U(log2Ceil(RefitPlan.linesInFlight + 1).W))
  private val isLine   = left =/= 0.U && entry.kind === RefitKind.lines && index =/= entry.count
  private val line     = entry.line(index)
  private val isKnown  = line < io.settings.lines
  private val request  = io.lines(1)
  request.valid := queue.io.deq.valid && isLine && inFlight =/= RefitPlan.linesInFlight.U
  request.bits  := (io.settings.vertices >> log2Ceil(RefitPlan.lineBytes)) + Mux(isKnown, line, 0.U)
  when(request.fire) { index := index + 1.U }
  inFlight := inFlight + request.fire - io.retired

  // What is behind the last entry in its line is dropped
  ahead.io.enq.valid := queue.io.deq.valid && left =/= 0.U && !isLine
  ahead.io.enq.bits  := entry
  queue.io.deq.ready := left === 0.U || (!isLine && ahead.io.enq.ready)
  when(ahead.io.enq.fire) {
    index := 0.U
    left  := left - 1.U
  }
  io.entries :<>= ahead.io.deq

  when(io.start) {
    next   := io.settings.plan >> log2Ceil(RefitPlan.lineBytes)
    unread := io.settings.entries
    left   := io.settings.entries
  }
  io.isIdle  := left === 0.U && taken === 0.U && ahead.io.count === 0.U
  io.isError := request.fire && !isKnown
}

object PlanReader {
  val depth: Int = 64 // entries that are read ahead, before and after their lines are requested
}

package colonnade.query

import chisel3._
import chisel3.experimental.hierarchy.{instantiable, public}
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.axi.{AxiReadPort, AxiWritePort}
import colonnade.column.{ColumnBvhController, TraversalRows}
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.{Load, NodeRecord, RayBatch, RayRegisters, RaySensor}
import colonnade.memory.{ColumnBvhMemory, ColumnCache, LineBroadcast, Lines}

/** Events of a column in one cycle; names as in the registers. */
final class RayEvents(config: ColonnadeConfig) extends Bundle {
  private def perUnit(most: Int = 1) = UInt(log2Ceil(config.array.rows * most + 1).W)

  val raysRefused   = Bool()
  val raysInBox     = perUnit()
  val nodeReads     = perUnit()
  val boxTests      = perUnit(NodeRecord.most)
  val triangleTests = perUnit()
  val stackOverflow = Bool()
  val illegalRecord = Bool()
  val deepestStack  = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)
}

final class RayColumnIO(config: ColonnadeConfig) extends Bundle {
  private val banks = config.columnBvhMemory.banks

  val registers = Input(new RayRegisters(config)) // constant while runs run, and so is the batch
  val batch     = Input(new RayBatch)
  val sensor    = Input(new RaySensor)
  val start     = Input(Bool())                   // before the first run of a batch
  val load      = Flipped(Valid(new Load(config)))
  val runs      = Flipped(Decoupled(new Run))
  val resolved  = Output(UInt(2.W))
  val failed    = Output(Bool())
  val read      = new AxiReadPort(1, RayBatch.bytes)
  val write     = new AxiWritePort(1, RayBatch.bytes)

  /** As of [[colonnade.column.Column]]. */
  val holds        = Option.when(config.columnBvhMemory.holdable)(Input(UInt(banks.W)))
  val lineRequests = config.columnBvhMemory.cache.map(_ => Vec(banks, Decoupled(UInt(Lines.lineBits(config).W))))
  val lines        = config.columnBvhMemory.cache.map(_ => Input(Vec(banks, new LineBroadcast(config))))
  val invalidate   = config.columnBvhMemory.cache.map(_ => Input(Bool()))
  val memoryError  = Option.when(Lines.hasParity(config))(Output(Bool()))
  val events       = Output(new RayEvents(config)) // delayed by one cycle
}

/** A column for rays of applications: [[RayQueries]], the traversal units that trace them, and the record memory. */
@instantiable
final class RayColumn(config: ColonnadeConfig) extends Module {
  @public val io = IO(new RayColumnIO(config))

  private val queries    = Module(new RayQueries(PathConfig(config))).io
  private val controller = Module(new ColumnBvhController(config)).io
  private val rows       = new TraversalRows(config)
  queries.batch     := io.batch
  queries.sensor    := io.sensor
  queries.placement := io.registers.placement
  queries.bounds    := io.registers.bounds
  queries.runs :<>= io.runs
  io.resolved := queries.resolved
  io.failed   := queries.failed
  io.read :<>= queries.read
  io.write :<>= queries.write
  queries.results :=
    rows.connect(queries.rays, io.registers.scene, io.start, controller.broadcasts, Some(io.batch.mask))

  // Records; the last requester is for attributes, which nobody reads
  for ((port, unit) <- controller.requests.zip(rows.units)) port :<>= unit.requests
  controller.requests.last.valid := false.B
  controller.requests.last.bits  := DontCare
  if (config.columnBvhMemory.cache.isEmpty) {
    val memory = Module(new ColumnBvhMemory(config)) // simulators look for it by this name
    memory.io.banks <> controller.memory
    memory.io.load := io.load
    memory.io.holds.zip(io.holds).foreach { case (to, from) => to := from }
  } else {
    val caches = controller.memory.map { port =>
      val cache = Module(new ColumnCache(config)).io
      cache.port <> port
      cache
    }
    for ((cache, bank) <- caches.zipWithIndex) {
      io.lineRequests.get(bank) :<>= cache.request
      cache.lines      := io.lines.get(bank)
      cache.invalidate := io.invalidate.get
    }
    for (error <- io.memoryError) error := RegNext(caches.flatMap(_.error).reduce(_ || _), false.B)
  }

  private val events      = Wire(new RayEvents(config))
  private val intersector = rows.units.map(_.events.intersector)
  events.raysRefused   := queries.refuses
  events.raysInBox     := intersector.map(_.raysInBox.asUInt).reduce(_ +& _)
  events.nodeReads     := intersector.map(_.nodeReads.asUInt).reduce(_ +& _)
  events.boxTests      := intersector.map(_.boxTests).reduce(_ +& _)
  events.triangleTests := intersector.map(_.triangleTests.asUInt).reduce(_ +& _)
  events.stackOverflow := intersector.map(_.stackOverflow).reduce(_ || _)
  events.illegalRecord := intersector.map(_.illegalRecord).reduce(_ || _) ||
    rows.units.map(_.events.fetch.illegalRecord).reduce(_ || _)
  events.deepestStack := intersector.map(_.deepestStack).reduce((a, b) => Mux(a > b, a, b))
  io.events           := RegNext(events)
}

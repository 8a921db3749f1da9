package colonnade.query

import chisel3._
import chisel3.experimental.hierarchy.{Definition, Instance}
import chisel3.util.{log2Ceil, Decoupled, Mux1H, OHToUInt, Pipe}
import colonnade.axi.{AxiAddress, AxiReadPort, AxiWritePort}
import colonnade.common.{Dispatcher, Merger, RoundRobin, TimingSlice}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{Load, RayBatch, RayRegisters, RayRing}
import colonnade.memory.{DramPort, SceneMemory, SharedCache}

final class RayArrayIO(config: ColonnadeConfig) extends Bundle {
  private val ids = RayPort.idBits(config.array.columns + 1)

  val registers = Input(new RayRegisters(config))      // constant while batches run
  val tail      = Input(UInt(RayRing.indexBits.W))
  val head      = Output(UInt(RayRing.indexBits.W))
  val load      = Flipped(Decoupled(new Load(config))) // ready while no batch runs

  /** Batches, rays and hits; with a cache, the scene. */
  val read   = new AxiReadPort(ids, RayBatch.bytes)
  val write  = new AxiWritePort(ids, RayBatch.bytes)
  val memory = config.columnBvhMemory.cache.map(_ => DramPort(config))

  /** For verification, as of [[colonnade.ColonnadeIO]]. */
  val memoryHolds = Option.when(config.columnBvhMemory.holdable)(
    Input(UInt((config.array.columns * config.columnBvhMemory.banks).W))
  )

  /** The caches forget the scene before the next batch. */
  val invalidate = Input(Bool())
  val isBusy     = Output(Bool())
  val events     = Output(Vec(config.array.columns, new RayEvents(config)))

  /** Pulses; rays whose hits are in memory. */
  val batchError  = Output(Bool())
  val memoryError = Output(Bool())
  val raysDone    = Output(UInt(32.W))
}

/** The columns of a device for rays, and the reader of batches that gives them runs. */
final class RayArray(config: ColonnadeConfig) extends Module {
  val io = IO(new RayArrayIO(config))

  private val reader     = Module(new BatchReader(config.array.columns)).io
  private val definition = Definition(new RayColumn(config)) // elaborated once, not once per column
  private val columns    = Seq.fill(config.array.columns)(Instance(definition).io)
  private val port       = Module(new RayPort(columns.size + 1)).io
  private val dispatch   = Module(new Dispatcher(new Run, columns.size)).io
  private val load       = Pipe(io.load.fire, io.load.bits)
  io.load.ready := !reader.isBusy

  reader.ring := io.registers.ring
  reader.tail := io.tail
  io.head     := reader.head
  io.isBusy   := reader.isBusy
  dispatch.items :<>= reader.runs
  for ((column, index) <- columns.zipWithIndex) {
    column.registers := io.registers
    column.batch     := reader.batch
    column.sensor    := reader.sensor
    column.start     := reader.start
    column.load      := load
    column.runs :<>= dispatch.takers(index)
    port.reads(index) :<>= column.read
    port.writes(index) :<>= column.write
    io.events(index)                                    := column.events
    for (to <- column.holds; from <- io.memoryHolds) to := from >> (index * config.columnBvhMemory.banks)
  }
  port.reads.last :<>= reader.read
  port.writes.last :<>= reader.write
  io.read :<>= port.read
  io.write :<>= port.write

  // The scene in DRAM
  private val sceneMemory = config.columnBvhMemory.cache.map(_ => Module(new SceneMemory(config)).io)
  private val isWrong     = columns.flatMap(_.memoryError).fold(false.B)(_ || _) // by parity
  private val hasFailed   = sceneMemory.fold(false.B)(_.events.error) || isWrong
  for (memory <- sceneMemory) {
    val isStale    = RegInit(false.B)
    val invalidate = isStale && reader.start
    isStale     := (isStale && !invalidate) || io.invalidate || hasFailed
    memory.page := io.registers.dram.get.page
    io.memory.get :<>= memory.axi
    val forgets = TimingSlice.flag(invalidate)
    memory.invalidate := forgets
    for (((column, requests), index) <- columns.zip(memory.requests).zipWithIndex) {
      requests :<>= column.lineRequests.get
      column.lines.get      := memory.lines(SharedCache.busOf(config, index))
      column.invalidate.get := forgets
    }
  }

  // A batch fails with its runs, and with what its rays read
  private val isIllegal = io.events.map(events => events.stackOverflow || events.illegalRecord).reduce(_ || _)
  reader.resolved := columns.map(_.resolved).reduce(_ +& _)
  reader.failed   := columns.map(_.failed).reduce(_ || _) || isIllegal || hasFailed
  io.batchError   := reader.isError
  io.memoryError  := hasFailed
  io.raysDone     := reader.raysDone
}

final class RayPortIO(count: Int) extends Bundle {
  val reads  = Vec(count, Flipped(new AxiReadPort(1, RayBatch.bytes)))
  val writes = Vec(count, Flipped(new AxiWritePort(1, RayBatch.bytes)))
  val read   = new AxiReadPort(RayPort.idBits(count), RayBatch.bytes)
  val write  = new AxiWritePort(RayPort.idBits(count), RayBatch.bytes)
}

/** One port for some masters, by round-robin; a master's number is its id, so responses of different ones may overtake
  * each other. The beats of a write follow its address before the next address is taken.
  */
final class RayPort(count: Int) extends Module {
  val io = IO(new RayPortIO(count))

  private val ids = RayPort.idBits(count)

  // Reads
  private val addresses = Module(new Merger(new AxiAddress(ids), count)).io
  for (((to, from), index) <- addresses.givers.zip(io.reads).zipWithIndex) {
    to :<>= from.ar
    to.bits.id := index.U
  }
  io.read.ar :<>= addresses.items
  for ((port, index) <- io.reads.zipWithIndex) {
    port.r.valid := io.read.r.valid && io.read.r.bits.id === index.U
    port.r.bits  := io.read.r.bits
  }
  io.read.r.ready := io.reads(io.read.r.bits.id).r.ready

  // Writes: the master whose beats are awaited
  private val arbiter = Module(new RoundRobin(count)).io
  private val sends   = RegInit(false.B)
  private val sender  = Reg(UInt(ids.W))
  private val grant   = arbiter.grant
  arbiter.requests    := Mux(sends, 0.U, VecInit(io.writes.map(_.aw.valid)).asUInt)
  arbiter.isTaken     := io.write.aw.fire
  io.write.aw.valid   := arbiter.requests.orR
  io.write.aw.bits    := Mux1H(grant, io.writes.map(_.aw.bits))
  io.write.aw.bits.id := OHToUInt(grant)
  io.write.w.valid    := sends && io.writes(sender).w.valid
  io.write.w.bits     := io.writes(sender).w.bits
  io.write.b.ready    := io.writes(io.write.b.bits.id).b.ready
  for ((port, index) <- io.writes.zipWithIndex) {
    port.aw.ready := grant(index) && io.write.aw.ready
    port.w.ready  := sends && sender === index.U && io.write.w.ready
    port.b.valid  := io.write.b.valid && io.write.b.bits.id === index.U
    port.b.bits   := io.write.b.bits
  }
  when(io.write.w.fire && io.write.w.bits.last) { sends := false.B }
  when(io.write.aw.fire) {
    sends  := true.B
    sender := OHToUInt(grant)
  }
}

object RayPort {
  def idBits(count: Int): Int = log2Ceil(count.max(2))
}

package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.axi.{Axi, AxiReadPort, AxiWritePort}
import colonnade.common.TimingSlice
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, Vec3}

final class RefitUnitIO(config: ColonnadeConfig, busBytes: Int) extends Bundle {

  /** A pulse, while idle; the settings are constant until idle. Result and errors are the last refit's. */
  val start    = Input(Bool())
  val settings = Input(new RefitSettings(config))
  val result   = Output(new RefitResult(config))
  val errors   = Output(new RefitErrors)
  val isIdle   = Output(Bool())

  val reads  = new AxiReadPort(RefitReader.idBits, busBytes)
  val writes = new AxiWritePort(RefitReader.idBits, busBytes)
}

/** Writes vertices into the records of a mesh, by a plan: what driver/src/colonnade_mesh.c does, byte for byte;
  * docs/bus-shell.md.
  */
final class RefitUnit(config: ColonnadeConfig, busBytes: Int) extends Module {
  val io = IO(new RefitUnitIO(config, busBytes))
  require(new RecordFormats(config).recordBits == 8 * RecordWriter.recordBytes, "records have 256 bits")

  private val reader = Module(new RefitReader(busBytes))
  private val plan   = Module(new PlanReader(config))
  private val ring   = Module(new VertexRing(config))
  private val leaves = Module(new LeafBuilder(config))
  private val items  = Module(new Queue(new RefitItem(config), RefitUnit.items, useSyncReadMem = true))
  private val stack  = Module(new BoxStack(config))
  private val nodes  = Module(new NodeBuilder(config))
  private val writer = Module(new RecordWriter(config, busBytes))

  private val settings  = io.settings
  private val isAligned = !((settings.plan | settings.vertices)(log2Ceil(RefitPlan.lineBytes) - 1, 0).orR ||
    settings.records(log2Ceil(RecordWriter.recordBytes) - 1, 0).orR)
  private val starts = io.start && isAligned
  plan.io.start    := starts
  plan.io.settings := settings
  reader.io.lines.zip(plan.io.lines).foreach { case (to, from) => to :<>= from }
  plan.io.data    := reader.io.data(0)
  plan.io.retired := ring.io.retired
  ring.io.entries :<>= plan.io.entries
  ring.io.data  := reader.io.data(1)
  ring.io.start := io.start
  leaves.steps :<>= ring.io.steps
  stack.io.clear := io.start
  items.io.enq :<>= leaves.items
  stack.io.items :<>= items.io.deq
  nodes.root := settings.root
  nodes.nodes :<>= stack.io.nodes
  writer.io.base  := settings.records
  writer.io.count := settings.count
  writer.io.records(0) :<>= nodes.records
  writer.io.records(1) :<>= stack.io.leaves
  io.reads :<>= reader.io.axi
  io.writes :<>= writer.io.axi

  private val isIdle =
    plan.io.isIdle && ring.io.isIdle && !leaves.items.valid &&
      items.io.count === 0.U && stack.io.isIdle && nodes.isIdle &&
      writer.io.isIdle
  io.isIdle := isIdle

  private val errors = RegInit(0.U.asTypeOf(new RefitErrors))
  private val result = Reg(new RefitResult(config))
  when(reader.io.isError || writer.io.isError) { errors.response := true.B }
  when(plan.io.isError || stack.io.isError || writer.io.isOutside) { errors.plan := true.B }
  when(stack.io.nodes.fire) {
    val all = stack.io.nodes.bits.all
    result.low  := all.low
    result.high := Vec3.of(all.below.axes.map(below => (below + 1.S).asUInt(config.geometry.vertexBits - 1, 0)))
  }
  when(leaves.items.fire && leaves.items.bits.isFlat) { result.flatPairs := result.flatPairs + 1.U }
  when(io.start) {
    errors           := 0.U.asTypeOf(errors)
    errors.alignment := !isAligned
    result.flatPairs := 0.U
  }
  io.result := result
  io.errors := errors
}

private object RefitUnit {
  val items: Int = 8 // leaves and nodes that wait, since nodes come in bursts
}

final class RefitReaderIO(busBytes: Int) extends Bundle {

  /** Lines to read, by their number: 0 of the plan, 1 of vertices. There is space for their data. */
  val lines = Vec(2, Flipped(Decoupled(UInt((Axi.addressBits - log2Ceil(RefitPlan.lineBytes)).W))))

  /** The data of each in order, 128 bits at a time. */
  val data    = Vec(2, Valid(UInt(RefitPlan.entryBits.W)))
  val axi     = new AxiReadPort(RefitReader.idBits, busBytes)
  val isError = Output(Bool()) // a pulse: a read has failed
}

/** Reads lines of 64 bytes, vertices first, and cuts beats to entries, or puts them together. */
final class RefitReader(busBytes: Int) extends Module {
  val io = IO(new RefitReaderIO(busBytes))

  private val entry = RefitPlan.entryBits / 8
  private val ar    = Wire(chiselTypeOf(io.axi.ar))
  private val id    = io.lines(1).valid
  ar.valid          := io.lines.map(_.valid).reduce(_ || _)
  ar.bits.id        := id
  ar.bits.addr      := Mux(id, io.lines(1).bits, io.lines(0).bits) ## 0.U(log2Ceil(RefitPlan.lineBytes).W)
  ar.bits.len       := (RefitPlan.lineBytes / busBytes - 1).U
  ar.bits.size      := Axi.size(busBytes)
  ar.bits.burst     := Axi.incr
  io.lines(0).ready := ar.ready && !id
  io.lines(1).ready := ar.ready
  io.axi.ar :<>= TimingSlice.queue(ar) // holds

  // A beat is cut to entries; narrow beats are put together, each stream apart: they may alternate
  private val beat   = TimingSlice.queue(io.axi.r)
  private val last   = (busBytes / entry).max(1) - 1
  private val part   = RegInit(0.U(log2Ceil(last + 1).max(1).W))
  private val pieces = entry / busBytes.min(entry)
  beat.ready := part === last.U
  when(beat.valid) { part := Mux(beat.ready, 0.U, part + 1.U) }
  for ((data, index) <- io.data.zipWithIndex) {
    val isHere = beat.valid && beat.bits.id === index.U
    if (pieces == 1) {
      data.valid := isHere
      data.bits  := (if (last == 0) beat.bits.data
                    else beat.bits.data.asTypeOf(Vec(last + 1, chiselTypeOf(data.bits)))(part))
    } else {
      val before = Reg(UInt((8 * (entry - busBytes)).W))
      val count  = RegInit(0.U(log2Ceil(pieces).W))
      data.valid := isHere && count.andR
      data.bits  := beat.bits.data ## before
      when(isHere) {
        count  := count + 1.U
        before := (beat.bits.data ## before) >> (8 * busBytes)
      }
    }
  }
  io.isError := io.axi.r.fire && io.axi.r.bits.resp =/= 0.U
}

object RefitReader {
  val idBits: Int = 1
}

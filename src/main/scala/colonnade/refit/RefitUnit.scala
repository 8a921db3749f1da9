package colonnade.refit

import chisel3._
import chisel3.util._
import colonnade.axi.{AxiReadPort, AxiWritePort}
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

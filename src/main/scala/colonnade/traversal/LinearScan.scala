package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.TraversalConfig
import colonnade.formats.{RecordFormats, SceneMap}

/** Traversal without a BVH, as a baseline: every ray visits every leaf, in memory order.
  *
  * The unit that starts a ray visits the first record. Each `resume` gives the next record one cycle later.
  */
final class LinearScan(config: TraversalConfig) extends Module {
  val io = IO(new Bundle {
    val scene  = Input(new SceneMap(config.device))
    val start  = Flipped(Valid(Context(config)))
    val resume = Flipped(Decoupled(Context(config)))
    val steps  = Decoupled(new TraversalStep(config))
  })

  /** By context: the number of records passed. */
  private val visited = Reg(Vec(config.contexts, UInt(RecordFormats.idBits(config.device).W)))

  private val isNext  = RegInit(false.B)
  private val context = Reg(Context(config))
  io.resume.ready := !isNext || io.steps.ready
  when(io.resume.ready) { isNext := io.resume.valid }
  when(io.resume.fire) { context := io.resume.bits }

  io.steps.valid               := isNext
  io.steps.bits.context        := context
  io.steps.bits.isDone         := visited(context) >= io.scene.recordCount
  io.steps.bits.target.isLeaf  := true.B
  io.steps.bits.target.address := visited(context)
  when(io.steps.fire) { visited(context) := visited(context) + io.scene.leafRecords(1.U) }
  when(io.start.valid) { visited(io.start.bits) := io.scene.leafRecords(1.U) }
}

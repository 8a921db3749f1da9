package colonnade.traversal

import chisel3._
import chisel3.util.{Decoupled, Valid}
import colonnade.common.Context
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, SceneMap}

/** The baseline without acceleration structure: every ray visits every triangles record, in the order of the memory.
  *
  * A context's first record is visited by whoever starts it; each `resume` gives the next, one cycle later.
  */
final class ExhaustiveWalk(config: ColonnadeConfig) extends Module {
  val io = IO(new Bundle {
    val scene  = Input(new SceneMap(RecordFormats.idBits(config)))
    val start  = Flipped(Valid(Context(config)))
    val resume = Flipped(Decoupled(Context(config)))
    val visits = Decoupled(new NextVisit(config))
  })

  /** By context: records visited. */
  private val visited = Reg(Vec(config.array.contexts, UInt(RecordFormats.idBits(config).W)))

  private val isNext  = RegInit(false.B)
  private val context = Reg(Context(config))
  io.resume.ready := !isNext || io.visits.ready
  when(io.resume.ready) { isNext := io.resume.valid }
  when(io.resume.fire) { context := io.resume.bits }

  io.visits.valid              := isNext
  io.visits.bits.context       := context
  io.visits.bits.isDone        := visited(context) >= io.scene.triangleRecords
  io.visits.bits.visit.isLeaf  := true.B
  io.visits.bits.visit.address := io.scene.triangleBase + visited(context)
  when(io.visits.fire) { visited(context) := visited(context) + 1.U }
  when(io.start.valid) { visited(io.start.bits) := 1.U }
}

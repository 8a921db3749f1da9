package colonnade.background

import chisel3._
import colonnade.config.ColonnadeConfig

/** Finds the point of the room that a ray meets: projects the ray into the map, where it is straight, and goes along it
  * from tile to tile until it is no longer in front of what the map shows. Rays that leave the map meet the shell.
  *
  * One ray at a time, and one question in flight. `docs/march.md` says how, and how long it takes.
  */
final class RoomMarch(config: ColonnadeConfig) extends Module {
  val io = IO(new RoomMarchIO(config))

  private val program    = new Microprogram
  private val datapath   = new MarchDatapath(config, program)
  private val projection = new MarchProjection(config, datapath, io.view, io.request.bits)
  private val axes       = new MarchAxes(datapath)
  private val planes     = new MarchPlanes(datapath, io.planes)
  private val walk       = new MarchWalk(datapath, planes, axes)
  private val tiles      = new MarchTiles(datapath, walk, planes, axes, io.cells)
  private val pass       = new MarchPass(datapath, walk, planes)
  private val pixels     = new MarchPixels(datapath, walk, pass.met)
  private val cells      = new MarchCells(datapath, walk, planes, axes, pixels, io.cells)
  private val ends       = new MarchEnds(datapath, walk, planes, pixels, pass.met, io.view)
  private val context    = Reg(chiselTypeOf(io.request.bits.context))
  private val isBusy     = WireInit(true.B)

  io.request.ready                         := false.B
  io.result.valid                          := false.B
  io.cells.question.valid                  := false.B
  io.cells.question.bits.tag               := 0.U
  io.cells.question.bits.content.pixel     := walk.cellCorner
  io.cells.question.bits.content.wholeTile := false.B

  program.step("start") {
    ends.clear()
    planes.forget()
    when(program.now)(isBusy := io.request.valid)
    program.await(io.request.valid)
  }
  projection.describe(behind = "finish") {
    when(program.now)(io.request.ready := true.B)
    program.set(context, io.request.bits.context)
  }
  axes.describe(outside = "shell")
  tiles.describe()
  planes.describe()
  pass.describe()
  cells.describe()
  pass.crossing()
  ends.describeMet()
  pixels.describe()
  ends.describeShell()
  program.step("finish") {
    when(program.now)(io.result.valid                := true.B)
    program.awaitOr(io.result.ready, io.result.ready -> "start")
  }
  program.build()
  datapath.build()

  ends.result(io.result.bits)
  io.result.bits.context := context
  io.events.step         := RegNext(walk.steps, 0.U) =/= walk.steps && walk.steps =/= 0.U
  io.events.busy         := isBusy
}

object RoomMarch {

  /** Of its questions: it knows what they are about. */
  val tagBits: Int = 1
}

package colonnade.environment

import chisel3._
import colonnade.config.ColonnadeConfig

/** Finds the point of the room that a ray meets, and what it is made of: projects the ray into the map, where it is
  * straight, and goes along it from tile to tile until it is no longer in front of what the map shows. Rays that leave the
  * map meet the shell. For a ray from the camera the pixel itself says what it meets.
  *
  * One ray at a time: its request is taken together with its result. `docs/march.md` says how, and how long it takes.
  */
final class RoomMarch(config: ColonnadeConfig) extends Module {
  val io = IO(new RoomMarchIO(config))

  private val program    = new Microprogram
  private val datapath   = new MarchDatapath(config, program)
  private val asked      = io.request.bits
  private val projection = new MarchProjection(config, datapath, io.view, asked)
  private val axes       = new MarchAxes(datapath)
  private val planes     = new MarchPlanes(datapath, io.maps.planes)
  private val walk       = new MarchWalk(datapath, planes, axes)
  private val tiles      = new MarchTiles(datapath, walk, planes, axes, io.maps.cells)
  private val pass       = new MarchPass(datapath, walk, planes)
  private val pixels     = new MarchPixels(datapath, walk, pass.met)
  private val cells      = new MarchCells(datapath, walk, planes, axes, pixels, io.maps.cells)
  private val texel      = new MarchTexel(datapath, planes, pixels, io.maps)
  private val ends       = new MarchEnds(datapath, walk, planes, pixels, texel, pass.met, io.view)
  private val seen    = new MarchSeen(datapath, projection, planes, pixels, texel, ends, io.maps.cells, io.view, asked)
  private val surface = new MarchSurface(datapath, texel, ends, io.view, asked)
  private val isBusy  = WireInit(true.B)

  io.request.ready                              := false.B
  io.result.valid                               := false.B
  io.maps.cells.question.valid                  := false.B
  io.maps.cells.question.bits.tag               := 0.U
  io.maps.cells.question.bits.content.pixel     := walk.cellCorner
  io.maps.cells.question.bits.content.wholeTile := false.B

  // What the maps have answered to this ray
  private val isIllegal = RegInit(false.B)
  private val answers   = Seq(io.maps.cells.answer, io.maps.albedo.answer, io.maps.normals.answer)
  when(answers.map(answer => answer.valid && answer.bits.isIllegal).reduce(_ || _)) { isIllegal := true.B }

  program.step("start") {
    program.set(isIllegal, false.B)
    ends.clear()
    planes.forget()
    when(program.now)(isBusy := io.request.valid)
    program.await(io.request.valid)
  }
  projection.describeHeading()
  projection.describe(behind = "finish")
  axes.describe(outside = "shell")
  tiles.describe()
  planes.describe()
  pass.describe()
  cells.describe()
  pass.crossing()
  ends.describeMet()
  pixels.describe()
  ends.describeShell()
  seen.describe()
  surface.describe()
  program.step("finish") {
    when(program.now) {
      io.result.valid  := true.B
      io.request.ready := io.result.ready
    }
    program.awaitOr(io.result.ready, io.result.ready -> "start")
  }
  program.build()
  datapath.build()

  ends.result(io.result.bits)
  surface.result(io.result.bits)
  io.result.bits.context   := asked.context
  io.result.bits.isIllegal := isIllegal
  io.events.step           := RegNext(walk.steps, 0.U) =/= walk.steps && walk.steps =/= 0.U
  io.events.busy           := isBusy
  io.events.illegal        := isIllegal
}

package colonnade.environment

import chisel3._
import chisel3.experimental.prefix
import colonnade.config.PathConfig
import colonnade.microcode.{Microprogram, Repeat}

/** Finds the point of the environment that a ray hits, with its albedo and normal. It projects the ray into the map, where
  * the ray is straight, and steps from tile to tile until the ray is no longer in front of the map's surfaces. A ray that
  * leaves the map hits a bounding plane. A ray from the maps' camera hits what its pixel shows: it goes to
  * [[DirectView]]. One from another camera is clipped to the maps' frustum; it hits what the maps show, or misses.
  *
  * One ray at a time; its request is taken together with its result. docs/march.md describes the steps and their latency.
  */
final class EnvironmentMarch(config: PathConfig) extends Module {
  val io = IO(new EnvironmentMarchIO(config))

  private val request    = io.request.bits
  private val datapath   = Module(new MarchDatapath(config))
  private val operations = new MarchOperations(config, datapath.io)
  private val projection = prefix("projection")(new RayProjection(operations, io.view, request))
  private val dda        = prefix("dda")(new DdaSetup(operations))
  private val planes     = prefix("planes")(new PlaneCache(operations, io.maps.planes))
  private val stepper    = prefix("stepper")(new TileStepper(operations, planes, dda))
  private val tiles      = prefix("tiles")(new TileProgram(operations, stepper, planes, dda, io.maps.cells))
  private val planeTest  = prefix("planeTest")(new PlaneTest(operations, stepper, planes))
  private val hitPixel   = prefix("hitPixel")(new HitPixel(operations, stepper, planeTest.hitDistance))
  private val cells      = prefix("cells")(new CellProgram(operations, stepper, planes, dda, hitPixel, io.maps.cells))
  private val texel      = prefix("texel")(new TexelFetch(operations, planes, hitPixel, io.maps))
  private val resolver   = prefix("resolver")(
    new HitResolver(operations, stepper, planes, hitPixel, texel, planeTest.hitDistance, io.view, request)
  )
  private val clip    = prefix("clip")(new RayClip(operations, stepper, resolver, io.view))
  private val surface = prefix("surface")(new SurfacePoint(operations, stepper, texel, resolver, io.view, request))
  private val isBusy  = WireInit(true.B)

  val program: Microprogram[MarchLabel] = operations.program

  io.request.ready                         := false.B
  io.result.valid                          := false.B
  io.maps.cells.req.valid                  := false.B
  io.maps.cells.req.bits.tag               := 0.U
  io.maps.cells.req.bits.content.pixel     := stepper.cellCorner
  io.maps.cells.req.bits.content.wholeTile := false.B

  // A response of the maps to the current ray was illegal
  private val isIllegal = RegInit(false.B)
  private val responses = Seq(io.maps.cells.resp, io.maps.albedo.resp, io.maps.normals.resp)
  when(responses.map(resp => resp.valid && resp.bits.isIllegal).reduce(_ || _)) { isIllegal := true.B }

  program.step(MarchLabel.Idle) {
    program.set(isIllegal, false.B)
    projection.clear()
    stepper.clear()
    planes.clear()
    hitPixel.clear()
    resolver.clear()
    when(program.now)(isBusy := io.request.valid)
    program.await(io.request.valid, "request")
  }
  projection.describe()
  dda.describe()
  tiles.describe()
  planes.describe()
  planeTest.describe()
  cells.describe()
  planeTest.describeCrossing()
  resolver.describeHit()
  hitPixel.describe()
  resolver.describeBoundingPlanes()
  clip.describe()
  surface.describe()
  program.step(MarchLabel.Finish) {
    when(program.now) {
      io.result.valid  := true.B
      io.request.ready := io.result.ready
    }
    program.branch(Repeat.until(io.result.ready, "the result is taken"), MarchLabel.Idle.otherwise)
  }
  operations.build()

  resolver.result(io.result.bits)
  surface.result(io.result.bits)
  io.result.bits.context   := request.context
  io.result.bits.isIllegal := isIllegal
  io.events.step           := RegNext(stepper.steps, 0.U) =/= stepper.steps && stepper.steps =/= 0.U
  io.events.busy           := isBusy
  io.events.illegal        := isIllegal
}

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
  private val reader     = prefix("reader")(new CellReader(operations, io.maps.cells))
  private val dda        = prefix("dda")(new DdaSetup(operations, reader))
  private val planes     = prefix("planes")(new PlaneCache(operations, io.maps.planes))
  private val stepper    = prefix("stepper")(new TileStepper(operations, planes, dda))
  private val tiles      = prefix("tiles")(new TileProgram(operations, stepper, planes, dda, reader))
  private val planeTest  = prefix("planeTest")(new PlaneTest(operations, stepper, planes))
  private val hitPixel   = prefix("hitPixel")(new HitPixel(operations, stepper, planeTest.hitDistance))
  private val cells      = prefix("cells")(new CellProgram(operations, stepper, planes, dda, hitPixel, reader))
  private val resolver   = prefix("resolver")(
    new HitResolver(operations, stepper, planes, hitPixel, planeTest.hitDistance, io.view, request)
  )
  private val clip   = prefix("clip")(new RayClip(operations, stepper, resolver, io.view, io.camera, io.test))
  private val isBusy = WireInit(true.B)

  val program: Microprogram[MarchLabel] = operations.program

  io.request.ready := false.B
  io.hit.valid     := false.B

  program.step(MarchLabel.Idle) {
    projection.clear(io.camera)
    stepper.clear()
    planes.clear()
    resolver.clear()
    clip.clear()
    when(program.now) {
      isBusy := io.request.valid
      reader.channel.drop()
    }
    program.branch(
      Repeat.until(io.request.valid, "request"),
      MarchLabel.ProjectDir.when(request.isFromCamera && io.camera.valid, "from a known camera")
    )
  }
  projection.describe(dda)
  dda.describe()
  tiles.describe()
  planes.describe(tiles.nextPlane, resolver.hasNext, stepper.exit)
  planeTest.describe()
  cells.describe()
  planeTest.describeCrossing()
  resolver.describeHit()
  hitPixel.describe(resolver.measureDistance)
  resolver.describeBoundingPlanes()
  clip.describe()
  program.step(MarchLabel.Finish) {
    when(program.now) {
      io.hit.valid     := true.B
      io.request.ready := io.hit.ready
    }
    val hasTexel = resolver.kind === HitKind.boundingPlane
    program.branch(
      Repeat.until(io.hit.ready, "the hit is taken"),
      MarchLabel.Texel.when(hasTexel, "a bounding plane"),
      MarchLabel.Idle.otherwise
    )
  }
  planes.fetchTexel(resolver.boundingPlane, io.texel)
  operations.build()

  resolver.result(io.hit.bits)
  io.events.step    := stepper.isStep
  io.events.busy    := isBusy
  io.events.illegal := reader.isIllegal
}

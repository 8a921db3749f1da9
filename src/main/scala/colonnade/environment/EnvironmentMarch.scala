package colonnade.environment

import chisel3._
import chisel3.experimental.prefix
import chisel3.util.{Decoupled, RegEnable, Valid}
import colonnade.config.{AttributeLayout, PathConfig}
import colonnade.formats.EnvironmentView
import colonnade.microcode.{Microprogram, Repeat}

/** Finds the point of the environment that a ray hits, with its albedo and normal. It projects the ray into the map,
  * where the ray is straight, and steps from tile to tile until the ray is no longer in front of the map's surfaces. A
  * ray that leaves the map hits a bounding plane. A ray from the maps' camera hits what its pixel shows: it goes to
  * [[DirectView]]. One from another camera is clipped to the maps' frustum; it hits what the maps show, or misses.
  *
  * One ray at a time; its request is taken together with its result. docs/march.md describes the steps and their
  * latency.
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

/** A hit of a march, with its order. */
final class OrderedHit(config: PathConfig) extends Bundle {
  val hit   = new MarchHit(config)
  val order = new MarchOrder(config)
}

final class MarchSlotIO(config: PathConfig) extends Bundle {
  val view    = Input(new EnvironmentView(config.numbers)) // constant while a frame runs
  val camera  = Flipped(Valid(new CameraOrigin(config)))   // see [[EnvironmentMarchIO]]
  val order   = Flipped(Valid(new MarchOrder(config)))     // only in a cycle after one with `isEmpty`
  val isEmpty = Output(Bool())                             // no order is held
  val hit     = Decoupled(new OrderedHit(config))
  val texel   = Valid(new BoundingTexel)
  val maps    = new MarchMaps(AttributeLayout.of(config.device))
  val test    = Valid(new ClipTest(config))
  val events  = Output(new MarchEvents)
}

/** An [[EnvironmentMarch]] with the order that it works on. */
final class MarchSlot(config: PathConfig) extends Module {
  val io = IO(new MarchSlotIO(config))

  private val march  = Module(new EnvironmentMarch(config)).io
  private val isHeld = RegInit(false.B)
  private val order  = RegEnable(io.order.bits, io.order.valid)
  when(io.order.valid) { isHeld := true.B }.elsewhen(march.request.ready) { isHeld := false.B }
  io.isEmpty := !isHeld

  march.view                      := io.view
  march.camera                    := io.camera
  march.request.valid             := isHeld
  march.request.bits.ray          := order.ray
  march.request.bits.isFromCamera := order.request.isDirectView
  io.maps <> march.maps
  io.texel  := march.texel
  io.test   := march.test
  io.events := march.events

  io.hit.valid      := march.hit.valid
  io.hit.bits.hit   := march.hit.bits
  io.hit.bits.order := order
  march.hit.ready   := io.hit.ready
}

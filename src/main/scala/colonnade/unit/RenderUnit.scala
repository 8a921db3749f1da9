package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Arbiter, Decoupled, Pipe, PopCount, Queue, RegEnable, Valid}
import colonnade.common.{Context, ContextTable}
import colonnade.config.ColonnadeConfig
import colonnade.environment.{AttributePort, RoomStage, RoomStageIO}
import colonnade.formats.{FrameRegisters, Pixel, PixelHit, PixelPosition, RecordFormats}
import colonnade.numbers.Rounding
import colonnade.ray.{RayGenerator, RayRequest, RaySetup, TracedRay}
import colonnade.shading.{ColourUnit, PathColour, Shader, ShadowRays}
import colonnade.traversal.{NodeRef, TriangleLanes}

/** One render unit: turns pixel positions into pixels, with `contexts` rays in flight.
  *
  * Pixels come out in any order, which depends on timing; their values do not.
  */
final class RenderUnit(config: ColonnadeConfig) extends Module {
  private val contexts = config.array.contexts
  private val numbers  = config.numbers
  private val formats  = new RecordFormats(config)

  val io = IO(new RenderUnitIO(config))

  private val events       = io.events
  private val controller   = Module(new RtController(config))
  private val rayGenerator = Module(new RayGenerator(config))
  private val raySetup     = Module(new RaySetup(config))
  private val recordFetch  = Module(new RecordFetch(config))
  private val traversal    = Module(new Traversal(config))
  private val triangleUnit = Module(new TriangleLanes(config))
  private val hitTable     = Module(new HitTable(config))
  private val shader       = Module(new Shader(config))
  private val shadowRays   = Module(new ShadowRays(config))
  private val colourUnit   = Module(new ColourUnit(config))
  private val room         = if (config.hasRoom) Some(Module(new RoomStage(config)).io) else None

  // What each context remembers, in memories that are read a cycle before
  private val positions = ContextTable(config, new PixelPosition(config))
  private val rays      = ContextTable(config, new TracedRay(numbers))
  private val entries   = ContextTable(config, UInt(numbers.entryBits.W))
  private val colours   = ContextTable(config, new PathColour(config))
  private val isObject  = Reg(Vec(contexts, Bool()))

  /** The pixel's own ray may meet the object. */
  private val meetsObject = if (config.hasRoom) Reg(Vec(contexts, Bool())) else VecInit.fill(contexts)(true.B)

  // A position takes a free context
  private val position = io.positions.bits
  rayGenerator.io.position.valid        := io.positions.valid && controller.io.free.valid
  rayGenerator.io.position.bits.context := controller.io.free.bits
  rayGenerator.io.position.bits.x       := position.x
  rayGenerator.io.position.bits.y       := position.y
  io.positions.ready                    := rayGenerator.io.position.ready && controller.io.free.valid
  controller.io.allocate                := rayGenerator.io.position.fire
  when(rayGenerator.io.position.fire) {
    positions.write(controller.io.free.bits, pixelOf(position.x, position.y))
    isObject(controller.io.free.bits) := false.B
    position.meetsObject.foreach(meetsObject(controller.io.free.bits) := _)
  }
  rayGenerator.io.registers.camera    := io.registers.camera
  rayGenerator.io.registers.unitShift := io.registers.frame.unitShift

  // Rays: those first whose pixels are nearer to their end
  private val requests = Module(new Arbiter(new RayRequest(config), 3))
  requests.io.in(0) :<>= shadowRays.io.ray
  if (!config.hasRoom) requests.io.in(2) :<>= rayGenerator.io.ray
  raySetup.io.request :<>= requests.io.out
  raySetup.io.bounds := io.registers.bounds

  private val setUpRay = raySetup.io.ray
  private val enters   = setUpRay.fire && setUpRay.bits.enters
  setUpRay.ready := true.B
  when(enters) {
    rays.write(setUpRay.bits.context, setUpRay.bits.ray)
    entries.write(setUpRay.bits.context, setUpRay.bits.tEntry.natural)
  }
  hitTable.io.start.valid        := setUpRay.fire
  hitTable.io.start.bits.context := setUpRay.bits.context
  hitTable.io.start.bits.tMax    := setUpRay.bits.tMax
  connect(controller.io.entered, enters, setUpRay.bits.context)
  connect(controller.io.ended(0), setUpRay.fire && !setUpRay.bits.enters, setUpRay.bits.context)

  // Traversal: every visit is a wish for a record
  traversal.io.clear := io.start
  traversal.io.scene := io.registers.scene
  connect(traversal.io.start, enters, setUpRay.bits.context)
  private val (grantNext, response) = (recordFetch.io.grantNext, recordFetch.io.response)
  private val ray                   = rays.read(grantNext.bits, grantNext.valid)
  recordFetch.io.readyNext := VecInit(traversal.io.readyNext, triangleUnit.io.readyNext, shader.io.readyNext)
  traversal.io.nodes.valid := isFor(RecordKind.node)
  traversal.io.nodes.bits  := response.bits
  traversal.io.ray         := ray.forBoxes
  traversal.io.tMaxUnits   := hitTable.io.tMaxUnits
  traversal.io.steps.ready := true.B
  private val next = traversal.io.steps
  connect(controller.io.ended(1), next.fire && next.bits.isDone, next.bits.context)
  fetch(0, enters, setUpRay.bits.context, Traversal.root(config, io.registers.scene))
  fetch(1, next.fire && !next.bits.isDone, next.bits.context, next.bits.target)

  // Triangles
  triangleUnit.io.candidate.valid        := isFor(RecordKind.triangles)
  triangleUnit.io.candidate.bits.context := response.bits.context
  triangleUnit.io.candidate.bits.record  := formats.asTriangles(response.bits.record)
  triangleUnit.io.candidate.bits.ray     := ray.forTriangles

  // A result either ends its ray (a shadow ray that is occluded) or lets it go on
  private val tested     = triangleUnit.io.result
  private val isShadow   = controller.io.isShadow(tested.bits.context)
  private val isOccluded = isShadow && hitTable.io.hasHitNow
  private val resumes    = Module(new Arbiter(Context(config), 2))
  private val isThrough  = tested.valid && tested.bits.isLast
  tested.ready             := isOccluded || !tested.bits.isLast || resumes.io.in(1).ready
  hitTable.io.result.valid := tested.fire
  hitTable.io.result.bits  := tested.bits
  hitTable.io.isShadow     := isShadow
  controller.io.ended(2)   := Pipe(tested.fire && tested.bits.isLast && isOccluded, tested.bits.context)
  resumes.io.in(1).valid   := isThrough && !isOccluded
  resumes.io.in(1).bits    := tested.bits.context
  traversal.io.resume :<>= resumes.io.out

  // A record that does not exist is passed over; a pixel without attributes stays as it is
  private val error        = recordFetch.io.error
  private val isAttributes = error.bits.kind === RecordKind.attributes
  resumes.io.in(0).valid := error.valid && !isAttributes
  resumes.io.in(0).bits  := error.bits.context
  connect(controller.io.dropped, error.valid && isAttributes, error.bits.context)

  // An ended ray: a hit wishes for its attributes, unless it is in a light's way
  private val judged = controller.io.judged
  private val isSeen = judged.valid && hitTable.io.hasHit(judged.bits) && !controller.io.isShadow(judged.bits)
  controller.io.hasHit     := hitTable.io.hasHit
  controller.io.occlusions := hitTable.io.occlusions
  when(isSeen) { isObject(judged.bits) := true.B }
  private val seen    = RegNext(isSeen, false.B)
  private val isFirst = RegNext(isSeen && controller.io.isPrimary(judged.bits), false.B)
  hitTable.io.closest.context := RegEnable(judged.bits, isSeen)
  private val closest = hitTable.io.closest
  recordFetch.io.fetches(2).valid        := seen
  recordFetch.io.fetches(2).bits.context := closest.context
  recordFetch.io.fetches(2).bits.kind    := RecordKind.attributes
  recordFetch.io.fetches(2).bits.address :=
    io.registers.scene.attributeBase + (closest.id >> RecordFormats.faceSlotBits)

  // Shading
  hitTable.io.grantNext       := grantNext
  hitTable.io.responseContext := response.bits.context
  private val shadedHit = hitTable.io.hit
  shader.io.request.valid        := isFor(RecordKind.attributes)
  shader.io.request.bits.context := response.bits.context
  shader.io.request.bits.ray     := ray.forTriangles
  shader.io.request.bits.hit     := shadedHit
  shader.io.request.bits.face    := formats.asAttributes(response.bits.record).faces(shadedHit.id(
    RecordFormats.faceSlotBits - 1,
    0
  ))
  shader.io.lights    := io.registers.lights
  shader.io.unitShift := io.registers.frame.unitShift
  shader.io.shading   := io.registers.shading
  shader.io.materials := io.registers.materials

  // A surface that ends its path asks for its lights, one after the other
  private val lit = shader.io.lit
  lit.ready                                 := true.B
  controller.io.shaded.valid                := lit.valid
  controller.io.shaded.bits.context         := lit.bits.context
  controller.io.shaded.bits.needsShadowRays := lit.bits.needsShadowRays
  shadowRays.io.lights                      := io.registers.lights
  shadowRays.io.unitShift                   := io.registers.frame.unitShift
  shadowRays.io.surface.valid               := lit.valid
  shadowRays.io.surface.bits                := lit.bits
  shadowRays.io.question :<>= controller.io.shadow

  // A mirror or glass turns its path
  requests.io.in(1).valid := false.B
  requests.io.in(1).bits  := DontCare
  controller.io.bounced   := 0.U.asTypeOf(controller.io.bounced)
  events.raysReflection   := false.B
  events.raysRefraction   := false.B
  private val turns = shader.io.bounced.zip(colourUnit.io.turn).map { case (bounced, turn) =>
    val turns = Module(new PathTurns(config)).io
    turns.shading := io.registers.shading
    connect(turns.begins, controller.io.allocate, controller.io.free.bits)
    turns.bounced :<>= bounced
    turn :<>= turns.turn
    requests.io.in(1) :<>= turns.ray
    controller.io.bounced := turns.turned
    events.raysReflection := turns.ray.fire && !turns.isRefraction
    events.raysRefraction := turns.ray.fire && turns.isRefraction
    turns
  }

  // Rays beyond the object
  for (stage <- room; control <- controller.io.room; maps <- io.maps) meetRoom(stage, control, maps)

  // Colours
  colourUnit.io.ambient       := io.registers.ambient
  colourUnit.io.background    := io.registers.background
  colourUnit.io.shading       := io.registers.shading
  colourUnit.io.begins.valid  := controller.io.allocate
  colourUnit.io.begins.bits   := controller.io.free.bits
  colourUnit.io.surface.valid := lit.valid
  colourUnit.io.surface.bits  := lit.bits
  colourUnit.io.end :<>= controller.io.end
  private val coloured = colourUnit.io.colour
  connect(controller.io.coloured, coloured.valid, coloured.bits.context)
  when(coloured.valid) { colours.write(coloured.bits.context, coloured.bits) }

  // Pixels: a context is free as soon as its tables are being read, when there is a place for what they hold
  private val complete = controller.io.complete
  private val finished = Wire(Decoupled(new Pixel(config)))
  private val outgoing = Module(new Queue(new Pixel(config), 1))
  private val leaves   = complete.valid && outgoing.io.enq.ready && !finished.valid
  controller.io.leave := leaves
  private val colour = colours.read(complete.bits, leaves)
  private val place  = positions.read(complete.bits, leaves)
  finished.valid  := RegNext(leaves, false.B)
  finished.bits.x := place.x
  finished.bits.y := place.y
  private val isColoured = RegEnable(controller.io.isColoured(complete.bits), leaves)
  finished.bits.colour :=
    Mux(isColoured, colour.colour, io.registers.background)
  for (ratio <- finished.bits.ratio; left <- colour.ratio; channel <- 0 until 3)
    ratio.channels(channel) :=
      Mux(isColoured && !finished.bits.isObject, left.channels(channel), FrameRegisters.whole)
  finished.bits.isObject := RegEnable(isObject(complete.bits), leaves)
  finished.bits.hit.foreach(_ := 0.U.asTypeOf(new PixelHit(config)))
  if (config.frame.hits) {
    val pixelHits = ContextTable(config, new PixelHit(config))
    val entry     = entries.read(judged.bits, isSeen)
    when(isFirst) {
      val pixelHit = Wire(new PixelHit(config))
      pixelHit.triangle     := closest.id
      pixelHit.distance.raw := Rounding.floor(entry, -numbers.gridFraction) +& closest.t.integer.asUInt
      pixelHits.write(closest.context, pixelHit)
    }
    val pixelHit = pixelHits.read(complete.bits, leaves)
    when(finished.bits.isObject) { finished.bits.hit.get := pixelHit }
  }
  outgoing.io.enq :<>= finished
  io.pixels :<>= outgoing.io.deq

  // The record port
  recordFetch.io.start      := io.start
  recordFetch.io.row        := io.row
  recordFetch.io.scene      := io.registers.scene
  recordFetch.io.broadcasts := io.broadcasts
  io.requests :<>= recordFetch.io.requests

  // Counters
  events.raysShadow       := shadowRays.io.ray.fire
  events.raysInBox        := enters
  events.nodeReads        := traversal.io.nodes.fire
  events.boxTests         := traversal.io.boxTests
  events.triangleTests    := tested.fire
  events.hits             := isFirst
  events.snoopHits        := recordFetch.io.snoopHits
  events.busyRaySetup     := raySetup.io.busy
  events.busyBoxUnit      := traversal.io.busy
  events.busyTriangleUnit := triangleUnit.io.busy
  events.busyShader       := shader.io.busy

  events.idleContexts      := controller.io.freeCount
  events.contextsSetUp     := controller.io.setUpCount
  events.waitRecord        := recordFetch.io.stalledContexts
  events.waitUnit          := recordFetch.io.readyContexts
  events.contextsBox       := population(Seq(traversal.io.nodes.fire, traversal.io.resume.fire), next.fire)
  events.contextsTriangles := population(Seq(triangleUnit.io.candidate.fire), tested.fire && tested.bits.isLast)
  events.contextsShading   := population(
    shader.io.request.fire +: shader.io.room.map(_.fire).toSeq,
    PopCount(lit.fire +: shader.io.bounced.map(_.fire).toSeq)
  )

  events.raysRoom.foreach(_ := controller.io.room.get.question.fire)
  events.marchSteps.foreach(_ := room.get.events.step)
  events.busyRoom.foreach(_ := room.get.events.busy)
  events.contextsRoom.foreach(_ := controller.io.roomCount.get)

  events.deepestStack  := traversal.io.deepest
  events.stackOverflow := traversal.io.overflow
  events.illegalRecord := error.valid || traversal.io.illegal ||
    (triangleUnit.io.candidate.fire && !triangleUnit.io.candidate.bits.record.isLegal) ||
    room.map(_.events.illegal).getOrElse(false.B)
  io.isIdle := controller.io.freeCount === contexts.U && !finished.valid && !io.pixels.valid

  // A record comes only to a unit that takes it
  for ((unit, index) <- Seq(traversal.io.nodes, triangleUnit.io.candidate, shader.io.request).zipWithIndex)
    assert(!unit.valid || unit.ready, s"unit $index has a record that it does not take")

  /** What rays do that meet nothing of the object, in a frame with a room. */
  private def meetRoom(stage: RoomStageIO, control: RoomControl, maps: AttributePort): Unit = {
    val view = io.registers.room.get
    control.isThere := view.isThere
    stage.view      := view
    maps <> stage.maps
    stage.question :<>= control.question
    control.nothing := stage.nothing
    shader.io.room.get :<>= stage.surface
    connect(control.met, stage.surface.fire, stage.surface.bits.context)

    control.aside      := 0.U.asTypeOf(control.aside)
    control.turn.ready := false.B
    for (turning <- turns.flatMap(_.room)) {
      turning.isThere := view.isThere
      control.aside   := turning.aside
      turning.resume :<>= control.turn
    }

    // Every ray that may meet the room is remembered; those of turning paths come first
    val first     = rayGenerator.io.ray
    val context   = first.bits.context
    val turning   = turns.flatMap(_.room).map(_.ray)
    val isTurning = turning.map(_.valid).getOrElse(false.B)
    requests.io.in(2).valid := first.valid && !isTurning && meetsObject(context)
    requests.io.in(2).bits  := first.bits
    first.ready             := !isTurning && (requests.io.in(2).ready || !meetsObject(context))
    connect(control.passes, first.fire && !meetsObject(context), context)
    stage.ray.valid            := isTurning || first.fire
    stage.ray.bits.context     := context
    stage.ray.bits.ray.origin  := first.bits.origin
    stage.ray.bits.ray.towards := first.bits.dir
    for (ray <- turning) when(ray.valid) { stage.ray.bits := ray.bits }
    stage.ray.bits.ray.pixel := pixelOf(rayGenerator.io.pixel.x, rayGenerator.io.pixel.y)
  }

  private def pixelOf(x: UInt, y: UInt): PixelPosition = {
    val pixel = Wire(new PixelPosition(config))
    pixel.x := x
    pixel.y := y
    pixel
  }

  /** The record served is for this use. */
  private def isFor(kind: RecordKind.Type): Bool = response.valid && response.bits.kind === kind

  /** Contexts that have entered and not left. */
  private def population(enter: Seq[Bool], leaves: UInt): UInt = {
    val count = RegInit(0.U(log2Ceil(contexts + 1).W))
    count := count + PopCount(enter) - leaves
    count
  }

  private def connect(port: Valid[UInt], valid: Bool, context: UInt): Unit = {
    port.valid := valid
    port.bits  := context
  }

  private def fetch(port: Int, valid: Bool, context: UInt, target: NodeRef): Unit = {
    recordFetch.io.fetches(port).valid        := valid
    recordFetch.io.fetches(port).bits.context := context
    recordFetch.io.fetches(port).bits.kind    := Mux(target.isLeaf, RecordKind.triangles, RecordKind.node)
    recordFetch.io.fetches(port).bits.address := target.address
  }
}

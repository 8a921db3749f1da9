package colonnade.unit

import colonnade.config.ColonnadeConfig
import colonnade.environment.{EnvironmentScene, ViewCase}

import scala.util.Random

/** The room that a small scene stands in, seen by the camera that its maps belong to; a strip of the frame to the left
  * and at the top is said not to see the object.
  *
  * @param isThere or else the frame is without a room, though the maps are loaded, and units get what may see the object
  */
final class SmallRoom(
    config:  ColonnadeConfig,
    scene:   SmallScene,
    random:  Random,
    frame:   Seq[Int],
    isThere: Boolean
) {
  private val numbers = config.numbers
  private val maps    = new EnvironmentScene(config, random)
  private val sizes   = Seq(config.physicalAttributeMemory.get.width, config.physicalAttributeMemory.get.height)

  /** By the memory's name. */
  val words: Map[String, Seq[BigInt]] = maps.words

  /** Together with the scene's; the object is 1.1 m across, and as far away. */
  val registers: Map[String, BigInt] = {
    val unitShift = scene.registers("frame.unitShift").toInt
    val stepShift = scene.registers("camera.stepShift").toInt
    val forwards  = scene.registers("camera.direction.z") << stepShift
    val camera    = "xyz".map(axis => scene.registers(s"camera.position.$axis") << unitShift)
    val metre     = (BigInt(1) << (numbers.vertexBits + numbers.gridFraction)).toDouble / 1.1
    val axes      = Seq(Seq(1.0, 0, 0), Seq(0, -1.0, 0), Seq(0, 0, 1.0))
    val view      = ViewCase.of(
      config,
      maps.focal,
      maps.middle,
      axes,
      camera,
      metre,
      ViewCase.stepWidths(config, frame)
    )
    def scaled(slope: Double): BigInt = BigDecimal(slope * forwards.toDouble).toBigInt
    val steps                         = Seq(0, 1).map(axis => sizes(axis).toDouble / frame(axis) / maps.focal)
    val corner                        = Seq(0, 1).map(axis => steps(axis) / 2 - maps.middle(axis) / maps.focal)
    // Beside the camera, so that the object's shadow falls where it is seen
    val light = "xyz".zip(camera.zip(Seq(-0.6, 0.25, 0.2))).map { case (axis, (from, by)) =>
      s"lights[0].position.$axis" -> ((from + BigDecimal(by * metre).toBigInt) >> unitShift)
    }
    scene.registers ++ light ++ view.fields.map { case (name, value) => s"room.$name" -> value } ++ Map[String, BigInt](
      "room.isThere"        -> (if (isThere) 1 else 0),
      "room.window.x0"      -> 0,
      "room.window.y0"      -> 0,
      "room.window.x1"      -> frame(0),
      "room.window.y1"      -> frame(1),
      "camera.direction.x"  -> (scaled(corner(0)) >> stepShift),
      "camera.direction.y"  -> (scaled(-corner(1)) >> stepShift),
      "camera.stepX.x"      -> scaled(steps(0)),
      "camera.stepY.y"      -> scaled(-steps(1)),
      "frame.objectRect.x0" -> (if (isThere) 2 else 0),
      "frame.objectRect.y0" -> (if (isThere) 1 else 0)
    )
  }
}

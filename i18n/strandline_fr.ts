<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" language="fr" sourcelanguage="en">
 <context>
  <name>Strandline</name>
  <message>
   <source>1 Survey</source>
   <translation>1 Levé</translation>
  </message>
  <message>
   <source>2 Surface</source>
   <translation>2 Surface</translation>
  </message>
  <message>
   <source>3 Change</source>
   <translation>3 Évolution</translation>
  </message>
  <message>
   <source>Tools</source>
   <translation>Outils</translation>
  </message>
  <message>
   <source>{} is not a survey folder: make one with 'Create survey'.</source>
   <translation>{} n'est pas un dossier de levé : créez-en un avec « Créer un levé ».</translation>
  </message>
  <message>
   <source>Cancelled.</source>
   <translation>Annulé.</translation>
  </message>
  <message>
   <source>There is nothing to write to {}.</source>
   <translation>Il n'y a rien à écrire dans {}.</translation>
  </message>
  <message>
   <source>Check engine</source>
   <translation>Vérifier le moteur</translation>
  </message>
  <message>
   <source>Tells whether the engine, the Python environment in which Strandline computes, is complete. With 'Install' it is made first: a virtual environment of about 1 GB in the QGIS profile, from the versions that Strandline was tested with. Nothing else in Strandline downloads anything.</source>
   <translation>Indique si le moteur, l'environnement Python dans lequel Strandline calcule, est complet. Avec « Installer », il est d'abord créé : un environnement virtuel d'environ 1 Go dans le profil QGIS, avec les versions pour lesquelles Strandline a été testé. Rien d'autre dans Strandline ne télécharge quoi que ce soit.</translation>
  </message>
  <message>
   <source>Install</source>
   <translation>Installer</translation>
  </message>
  <message>
   <source>Install or complete the engine before checking it.</source>
   <translation>Installer ou compléter le moteur avant de le vérifier.</translation>
  </message>
  <message>
   <source>Python to use</source>
   <translation>Python à utiliser</translation>
  </message>
  <message>
   <source>A Python of at least 3.11 to make a new environment with. Empty: one is looked for on this computer.</source>
   <translation>Un Python 3.11 ou plus récent avec lequel créer un nouvel environnement. Vide : il est cherché sur cet ordinateur.</translation>
  </message>
  <message>
   <source>Folder of wheels</source>
   <translation>Dossier de paquets wheel</translation>
  </message>
  <message>
   <source>Install from the Python packages in this folder instead of the network, for computers without one.</source>
   <translation>Installer à partir des paquets Python de ce dossier plutôt que du réseau, pour les ordinateurs qui n'en ont pas.</translation>
  </message>
  <message>
   <source>The engine is ready</source>
   <translation>Le moteur est prêt</translation>
  </message>
  <message>
   <source>The engine is ready: Python {}, {}.</source>
   <translation>Le moteur est prêt : Python {}, {}.</translation>
  </message>
  <message>
   <source>Installing the engine in {} with {}.</source>
   <translation>Installation du moteur dans {} avec {}.</translation>
  </message>
  <message>
   <source>The engine could not be installed: {} (see the lines above).</source>
   <translation>Le moteur n'a pas pu être installé : {} (voir les lignes ci-dessus).</translation>
  </message>
  <message>
   <source>Compare inputs</source>
   <translation>Comparer les entrées</translation>
  </message>
  <message>
   <source>Takes the same flight four times through tie points, orientation and georeferencing, with the same settings: as JPG, as RAW, and both enhanced (CeJPG, CeRAW); as JPG alone it makes two cases. The report says which gives the most tie points, the best coverage and the smallest errors on check points on your ground, and whether enhancement and RAW were worth it. It takes as long as all the cases together: try it on a part of a flight.</source>
   <translation>Fait passer quatre fois le même vol par les points de liaison, l'orientation et le géoréférencement, avec les mêmes réglages : en JPG, en RAW, et les deux rehaussés (CeJPG, CeRAW) ; en JPG seul, cela fait deux cas. Le rapport dit lequel donne le plus de points de liaison, la meilleure couverture et les plus petites erreurs aux points de contrôle sur votre terrain, et si le rehaussement et le RAW en valaient la peine. Cela dure autant que tous les cas réunis : essayez sur une partie d'un vol.</translation>
  </message>
  <message>
   <source>Folder of JPG photographs</source>
   <translation>Dossier de photographies JPG</translation>
  </message>
  <message>
   <source>Photographs of one flight (JPG, TIFF, PNG); sub-folders count.</source>
   <translation>Photographies d'un seul vol (JPG, TIFF, PNG) ; les sous-dossiers comptent.</translation>
  </message>
  <message>
   <source>Folder of RAW photographs</source>
   <translation>Dossier de photographies RAW</translation>
  </message>
  <message>
   <source>The same exposures as RAW, under the same names; it may be the same folder. Empty: JPG alone, two cases.</source>
   <translation>Les mêmes prises de vue en RAW, sous les mêmes noms ; ce peut être le même dossier. Vide : JPG seul, deux cas.</translation>
  </message>
  <message>
   <source>Marks in the RAW photographs</source>
   <translation>Pointés dans les photographies RAW</translation>
  </message>
  <message>
   <source>Only where the camera straightens its JPG, so that the RAW shows a point elsewhere by more than a shift; a JPG that is merely cut out of the RAW is recognised.</source>
   <translation>Seulement si l'appareil redresse son JPG, de sorte que le RAW montre un point ailleurs par plus qu'un décalage ; un JPG simplement découpé dans le RAW est reconnu.</translation>
  </message>
  <message>
   <source>CRS of the surveys</source>
   <translation>SCR des levés</translation>
  </message>
  <message>
   <source>Projected CRS of the results; empty: the UTM zone of the positions.</source>
   <translation>SCR projeté des résultats ; vide : la zone UTM des positions.</translation>
  </message>
  <message>
   <source>Enhancement</source>
   <translation>Rehaussement</translation>
  </message>
  <message>
   <source>How the enhanced cases are enhanced, as in 'Enhance photographs'; the others are only reduced to 8 bits.</source>
   <translation>Comment les cas rehaussés le sont, comme dans « Rehausser les photographies » ; les autres sont seulement ramenés à 8 bits.</translation>
  </message>
  <message>
   <source>Window</source>
   <translation>Fenêtre</translation>
  </message>
  <message>
   <source>Side of the enhancement's square window in pixels, an odd number.</source>
   <translation>Côté de la fenêtre carrée du rehaussement en pixels, un nombre impair.</translation>
  </message>
  <message>
   <source>Longest side</source>
   <translation>Plus grand côté</translation>
  </message>
  <message>
   <source>Photographs are reduced to this many pixels on their longer side before features are sought; 0 is full size.</source>
   <translation>Les photographies sont réduites à autant de pixels sur leur plus grand côté avant la recherche ; 0 garde leur pleine taille.</translation>
  </message>
  <message>
   <source>Camera model</source>
   <translation>Modèle d'appareil</translation>
  </message>
  <message>
   <source>The lens distortion that is estimated, as in 'Orient photographs'.</source>
   <translation>La distorsion de l'objectif qui est estimée, comme dans « Orienter les photographies ».</translation>
  </message>
  <message>
   <source>Comparison</source>
   <translation>Comparaison</translation>
  </message>
  <message>
   <source>A row for each case: tie points, their residual, coverage, errors on ground points.</source>
   <translation>Une ligne par cas : points de liaison, leur résidu, couverture, erreurs aux points au sol.</translation>
  </message>
  <message>
   <source>Folder to keep the surveys in</source>
   <translation>Dossier où garder les levés</translation>
  </message>
  <message>
   <source>The survey of each case is kept there, and an interrupted comparison goes on. Empty: they go at the end.</source>
   <translation>Le levé de chaque cas y est gardé, et une comparaison interrompue continue. Vide : ils disparaissent à la fin.</translation>
  </message>
  <message>
   <source>Exposures compared</source>
   <translation>Prises de vue comparées</translation>
  </message>
  <message>
   <source>Tie points per photograph, JPG</source>
   <translation>Points de liaison par photographie, JPG</translation>
  </message>
  <message>
   <source>Tie points per photograph, RAW</source>
   <translation>Points de liaison par photographie, RAW</translation>
  </message>
  <message>
   <source>Tie points per photograph, enhanced JPG</source>
   <translation>Points de liaison par photographie, JPG rehaussé</translation>
  </message>
  <message>
   <source>Tie points per photograph, enhanced RAW</source>
   <translation>Points de liaison par photographie, RAW rehaussé</translation>
  </message>
  <message>
   <source>Most tie points over those of the JPG</source>
   <translation>Plus grand nombre de points de liaison rapporté à celui du JPG</translation>
  </message>
  <message>
   <source>Create survey</source>
   <translation>Créer un levé</translation>
  </message>
  <message>
   <source>Makes a survey folder for the photographs of one flight: reads size, camera, time and GNSS position from each file, and chooses the CRS. The photographs stay where they are and are never changed. Every later step takes this folder and adds its own files to it.</source>
   <translation>Crée un dossier de levé pour les photographies d'un vol : lit la taille, l'appareil, l'heure et la position GNSS de chaque fichier, et choisit le SCR. Les photographies restent où elles sont et ne sont jamais modifiées. Chaque étape suivante prend ce dossier et y ajoute ses propres fichiers.</translation>
  </message>
  <message>
   <source>Folder of photographs</source>
   <translation>Dossier des photographies</translation>
  </message>
  <message>
   <source>Photographs of one flight (JPG, TIFF); sub-folders count.</source>
   <translation>Photographies d'un seul vol (JPG, TIFF) ; les sous-dossiers comptent.</translation>
  </message>
  <message>
   <source>Only files named</source>
   <translation>Seulement les fichiers nommés</translation>
  </message>
  <message>
   <source>A pattern such as *.JPG. Needed when a JPG and a RAW of the same name lie side by side: it picks one kind.</source>
   <translation>Un motif tel que *.JPG. Nécessaire quand un JPG et un RAW de même nom se côtoient : il en choisit un.</translation>
  </message>
  <message>
   <source>Positions of the photographs</source>
   <translation>Positions des photographies</translation>
  </message>
  <message>
   <source>A table (a CSV will do) with the fields image, x, y, z and, if known, sigma_h and sigma_v in metres. It replaces the positions in the photographs, for example after PPK processing.</source>
   <translation>Une table (un CSV convient) avec les champs image, x, y, z et, s'ils sont connus, sigma_h et sigma_v en mètres. Elle remplace les positions contenues dans les photographies, par exemple après un traitement PPK.</translation>
  </message>
  <message>
   <source>CRS of these positions</source>
   <translation>SCR de ces positions</translation>
  </message>
  <message>
   <source>CRS of x and y in the table; WGS 84 (longitude, latitude) when left empty.</source>
   <translation>SCR de x et y dans la table ; WGS 84 (longitude, latitude) si vide.</translation>
  </message>
  <message>
   <source>CRS of the survey</source>
   <translation>SCR du levé</translation>
  </message>
  <message>
   <source>Projected CRS of everything made from this survey. Empty: the UTM zone of the positions, if there are any.</source>
   <translation>SCR projeté de tout ce qui est tiré de ce levé. Vide : la zone UTM des positions, s'il y en a.</translation>
  </message>
  <message>
   <source>Survey folder</source>
   <translation>Dossier du levé</translation>
  </message>
  <message>
   <source>Folder to make. Choose a permanent place: it is the survey.</source>
   <translation>Dossier à créer. Choisissez un endroit permanent : c'est le levé.</translation>
  </message>
  <message>
   <source>Photograph positions</source>
   <translation>Positions des photographies</translation>
  </message>
  <message>
   <source>A point for every photograph with a position.</source>
   <translation>Un point pour chaque photographie qui a une position.</translation>
  </message>
  <message>
   <source>Photographs</source>
   <translation>Photographies</translation>
  </message>
  <message>
   <source>Photographs with a position</source>
   <translation>Photographies avec une position</translation>
  </message>
  <message>
   <source>The survey is made in QGIS's temporary folder and will be gone when QGIS closes: {}.</source>
   <translation>Le levé est créé dans le dossier temporaire de QGIS et disparaîtra à sa fermeture : {}.</translation>
  </message>
  <message>
   <source>DSM difference</source>
   <translation>Différence de MNS</translation>
  </message>
  <message>
   <source>Subtracts two surfaces (after minus before) and sums erosion, deposition and the net volume per zone, each with its standard deviation. That deviation counts noise, errors that neighbours share, and errors common to the whole surface separately. What no surface covers is not extrapolated: the share covered is told.</source>
   <translation>Soustrait deux surfaces (après moins avant) et somme l'érosion, le dépôt et le volume net par zone, chacun avec son écart-type. Celui-ci compte séparément le bruit, les erreurs que des voisins partagent et celles communes à toute la surface. Ce qu'aucune surface ne couvre n'est pas extrapolé : la part couverte est indiquée.</translation>
  </message>
  <message>
   <source>DSM before</source>
   <translation>MNS avant</translation>
  </message>
  <message>
   <source>The earlier surface.</source>
   <translation>La surface la plus ancienne.</translation>
  </message>
  <message>
   <source>DSM after</source>
   <translation>MNS après</translation>
  </message>
  <message>
   <source>The later surface; another grid or CRS is resampled to the coarser one.</source>
   <translation>La surface la plus récente ; une autre grille ou un autre SCR est rééchantillonné sur la plus grossière.</translation>
  </message>
  <message>
   <source>Nodata value</source>
   <translation>Valeur nodata</translation>
  </message>
  <message>
   <source>The value of empty cells in both surfaces, where their files do not say it.</source>
   <translation>La valeur des cellules vides des deux surfaces, quand leurs fichiers ne la disent pas.</translation>
  </message>
  <message>
   <source>Stable ground</source>
   <translation>Terrain stable</translation>
  </message>
  <message>
   <source>Polygons where nothing changed, such as rock or road: they tell the error of the difference.</source>
   <translation>Polygones où rien n'a changé, comme du rocher ou une route : ils révèlent l'erreur de la différence.</translation>
  </message>
  <message>
   <source>Zones</source>
   <translation>Zones</translation>
  </message>
  <message>
   <source>Polygons to sum volumes in; empty: the overlap of both surfaces.</source>
   <translation>Polygones dans lesquels sommer les volumes ; vide : le recouvrement des deux surfaces.</translation>
  </message>
  <message>
   <source>Field of zone names</source>
   <translation>Champ des noms de zones</translation>
  </message>
  <message>
   <source>Empty: the field 'name' if there is one, else the feature id.</source>
   <translation>Vide : le champ « name » s'il existe, sinon l'identifiant de l'entité.</translation>
  </message>
  <message>
   <source>Areas to ignore</source>
   <translation>Zones à ignorer</translation>
  </message>
  <message>
   <source>Polygons left out of everything, such as water or people.</source>
   <translation>Polygones exclus de tout, comme l'eau ou les personnes.</translation>
  </message>
  <message>
   <source>Co-registration</source>
   <translation>Recalage</translation>
  </message>
  <message>
   <source>What is taken off the difference: nothing (none), the median of stable ground (vertical), its tilted plane (plane), or what stable ground and the georeferencing of both surfaces tell together (auto), with a shift in plan where the relief of stable ground shows one for sure (auto) or in any case (horizontal). What is left in is counted in the deviations.</source>
   <translation>Ce qui est retranché de la différence : rien (none), la médiane du terrain stable (vertical), son plan incliné (plane), ou ce que disent ensemble le terrain stable et le géoréférencement des deux surfaces (auto), avec un décalage en plan là où le relief du terrain stable le montre sûrement (auto) ou dans tous les cas (horizontal). Ce qui reste est compté dans les écarts-types.</translation>
  </message>
  <message>
   <source>Level of detection</source>
   <translation>Seuil de détection</translation>
  </message>
  <message>
   <source>What counts as significant: each cell against its own deviation (cell), one threshold for all (uniform), or cells that agree with their neighbours (coherent).</source>
   <translation>Ce qui est tenu pour significatif : chaque cellule selon son propre écart-type (cell), un seuil pour toutes (uniform), ou les cellules qui s'accordent avec leurs voisines (coherent).</translation>
  </message>
  <message>
   <source>Confidence</source>
   <translation>Confiance</translation>
  </message>
  <message>
   <source>Of significance and of the interval of the net volume, between 0 and 1.</source>
   <translation>De la signification et de l'intervalle du volume net, entre 0 et 1.</translation>
  </message>
  <message>
   <source>Difference</source>
   <translation>Différence</translation>
  </message>
  <message>
   <source>After minus before in metres.</source>
   <translation>Après moins avant, en mètres.</translation>
  </message>
  <message>
   <source>Significant difference</source>
   <translation>Différence significative</translation>
  </message>
  <message>
   <source>The difference where it is significant.</source>
   <translation>La différence là où elle est significative.</translation>
  </message>
  <message>
   <source>Volumes</source>
   <translation>Volumes</translation>
  </message>
  <message>
   <source>The zones with their volumes in m3 and their deviations.</source>
   <translation>Les zones avec leurs volumes en m3 et leurs écarts-types.</translation>
  </message>
  <message>
   <source>Standard deviation of each height in metres, from 'Export DSM'.</source>
   <translation>Écart-type de chaque hauteur en mètres, tiré de « Exporter le MNS ».</translation>
  </message>
  <message>
   <source>Precision before</source>
   <translation>Précision avant</translation>
  </message>
  <message>
   <source>Precision after</source>
   <translation>Précision après</translation>
  </message>
  <message>
   <source>Standard deviation of the heights in metres, one number, where there is no precision raster.</source>
   <translation>Écart-type des hauteurs en mètres, un seul nombre, quand il n'y a pas de raster de précision.</translation>
  </message>
  <message>
   <source>Deviation before (m)</source>
   <translation>Écart-type avant (m)</translation>
  </message>
  <message>
   <source>Deviation after (m)</source>
   <translation>Écart-type après (m)</translation>
  </message>
  <message>
   <source>Deviation of the registration (m)</source>
   <translation>Écart-type du recalage (m)</translation>
  </message>
  <message>
   <source>Of one surface against the other as a whole; used where the stable ground cannot tell.</source>
   <translation>D'une surface entière par rapport à l'autre ; utilisé quand le terrain stable ne peut le dire.</translation>
  </message>
  <message>
   <source>Deviation of the registration in plan (m)</source>
   <translation>Écart-type du recalage en plan (m)</translation>
  </message>
  <message>
   <source>Of one surface against the other, east and north; used where the relief of stable ground cannot tell.</source>
   <translation>D'une surface par rapport à l'autre, vers l'est et le nord ; utilisé quand le relief du terrain stable ne peut le dire.</translation>
  </message>
  <message>
   <source>Range of shared errors (m)</source>
   <translation>Portée des erreurs partagées (m)</translation>
  </message>
  <message>
   <source>Up to which distance neighbouring cells err alike; used where the stable ground cannot tell.</source>
   <translation>Jusqu'à quelle distance des cellules voisines se trompent ensemble ; utilisé quand le terrain stable ne peut le dire.</translation>
  </message>
  <message>
   <source>{0}_PRECISION and {0}_SIGMA exclude each other: give one of them.</source>
   <translation>{0}_PRECISION et {0}_SIGMA s'excluent : donnez l'un des deux.</translation>
  </message>
  <message>
   <source>Net volume (m3)</source>
   <translation>Volume net (m3)</translation>
  </message>
  <message>
   <source>Deviation of the net volume (m3)</source>
   <translation>Écart-type du volume net (m3)</translation>
  </message>
  <message>
   <source>Its part from noise (m3)</source>
   <translation>Sa part due au bruit (m3)</translation>
  </message>
  <message>
   <source>Its part from errors that neighbours share (m3)</source>
   <translation>Sa part due aux erreurs que des voisins partagent (m3)</translation>
  </message>
  <message>
   <source>Its part from errors common to the surface (m3)</source>
   <translation>Sa part due aux erreurs communes à la surface (m3)</translation>
  </message>
  <message>
   <source>Erosion (m3)</source>
   <translation>Érosion (m3)</translation>
  </message>
  <message>
   <source>Deviation of the erosion (m3)</source>
   <translation>Écart-type de l'érosion (m3)</translation>
  </message>
  <message>
   <source>Deposition (m3)</source>
   <translation>Dépôt (m3)</translation>
  </message>
  <message>
   <source>Deviation of the deposition (m3)</source>
   <translation>Écart-type du dépôt (m3)</translation>
  </message>
  <message>
   <source>Significant erosion (m3)</source>
   <translation>Érosion significative (m3)</translation>
  </message>
  <message>
   <source>Significant deposition (m3)</source>
   <translation>Dépôt significatif (m3)</translation>
  </message>
  <message>
   <source>Significant net volume (m3)</source>
   <translation>Volume net significatif (m3)</translation>
  </message>
  <message>
   <source>Area (m2)</source>
   <translation>Aire (m2)</translation>
  </message>
  <message>
   <source>Area covered by both surfaces (%)</source>
   <translation>Aire couverte par les deux surfaces (%)</translation>
  </message>
  <message>
   <source>Enhance photographs</source>
   <translation>Rehausser les photographies</translation>
  </message>
  <message>
   <source>Raises the local contrast of bare sand so that tie points can be found on it. The enhanced images serve tie points only: the surface and the orthophoto are always made from the original photographs.</source>
   <translation>Augmente le contraste local du sable nu pour que des points de liaison s'y trouvent. Les images rehaussées ne servent qu'aux points de liaison : la surface et l'orthophoto viennent toujours des photographies d'origine.</translation>
  </message>
  <message>
   <source>Method</source>
   <translation>Méthode</translation>
  </message>
  <message>
   <source>bandpass: takes off as much fine noise as each photograph has and lifts its fine texture, then as arctan; it gives the most tie points on sand. arctan: each pixel against the mean and deviation of its window, through an arc tangent (Rosu et al. 2015). micmac: MicMac's variant. equalize: the image's whole histogram. none: only reduced to 8 bits.</source>
   <translation>bandpass : ôte autant de bruit fin que chaque photographie en a et relève sa texture fine, puis comme arctan ; c'est ce qui donne le plus de points de liaison sur le sable. arctan : chaque pixel rapporté à la moyenne et à l'écart type de sa fenêtre, par un arc tangente (Rosu et al. 2015). micmac : la variante de MicMac. equalize : l'histogramme entier de l'image. none : seulement ramené à 8 bits.</translation>
  </message>
  <message>
   <source>Side of the square window in pixels, an odd number. Larger windows keep more of the broad shapes.</source>
   <translation>Côté de la fenêtre carrée en pixels, un nombre impair. Les grandes fenêtres conservent mieux les formes étendues.</translation>
  </message>
  <message>
   <source>Polygons of water, people or vehicles; no tie points are sought there. It needs to know where the photographs look: a georeferenced survey, or positions with yaw and height in the photographs.</source>
   <translation>Polygones d'eau, de personnes ou de véhicules ; aucun point de liaison n'y est cherché. Il faut savoir où regardent les photographies : un levé géoréférencé, ou des positions avec lacet et hauteur dans les photographies.</translation>
  </message>
  <message>
   <source>Export DSM</source>
   <translation>Exporter le MNS</translation>
  </message>
  <message>
   <source>Computes the surface of a georeferenced survey by correlating the original photographs, cell by cell, with the precision of each height. Cells that cannot be measured stay empty.</source>
   <translation>Calcule la surface d'un levé géoréférencé en corrélant les photographies d'origine, cellule par cellule, avec la précision de chaque hauteur. Les cellules qui ne peuvent être mesurées restent vides.</translation>
  </message>
  <message>
   <source>Cell size (m)</source>
   <translation>Taille des cellules (m)</translation>
  </message>
  <message>
   <source>Side of a cell on the ground; 0 is twice the photographs' pixel.</source>
   <translation>Côté d'une cellule au sol ; 0 vaut deux fois le pixel des photographies.</translation>
  </message>
  <message>
   <source>Area</source>
   <translation>Emprise</translation>
  </message>
  <message>
   <source>Only inside these polygons; empty: wherever enough photographs look.</source>
   <translation>Seulement dans ces polygones ; vide : partout où assez de photographies regardent.</translation>
  </message>
  <message>
   <source>Polygons left empty, such as water or vegetation.</source>
   <translation>Polygones laissés vides, comme l'eau ou la végétation.</translation>
  </message>
  <message>
   <source>Correlation window</source>
   <translation>Fenêtre de corrélation</translation>
  </message>
  <message>
   <source>Side of the window in cells, an odd number; 0 adapts it to the contrast: larger on plain sand.</source>
   <translation>Côté de la fenêtre en cellules, un nombre impair ; 0 l'adapte au contraste : plus grande sur le sable uni.</translation>
  </message>
  <message>
   <source>Regularity</source>
   <translation>Régularité</translation>
  </message>
  <message>
   <source>How much the surface resists to jump from cell to cell: higher is smoother, 0 lets every cell speak for itself.</source>
   <translation>Combien la surface résiste aux sauts d'une cellule à l'autre : plus haut est plus lisse, 0 laisse chaque cellule parler pour elle-même.</translation>
  </message>
  <message>
   <source>Fill gaps up to (m2)</source>
   <translation>Combler les trous jusqu'à (m2)</translation>
  </message>
  <message>
   <source>Gaps up to this area are closed by interpolation and marked in 'Filled cells', but never where they touch an area to ignore or the surface's edge; 0 leaves them empty.</source>
   <translation>Les trous jusqu'à cette surface sont comblés par interpolation et marqués dans « Cellules comblées », mais jamais lorsqu'ils touchent une zone à ignorer ou le bord de la surface ; 0 les laisse vides.</translation>
  </message>
  <message>
   <source>DSM</source>
   <translation>MNS</translation>
  </message>
  <message>
   <source>Heights in metres, in the survey's CRS.</source>
   <translation>Hauteurs en mètres, dans le SCR du levé.</translation>
  </message>
  <message>
   <source>Precision</source>
   <translation>Précision</translation>
  </message>
  <message>
   <source>Standard deviation of each height in metres, from matching alone; 'DSM difference' uses it.</source>
   <translation>Écart-type de chaque hauteur en mètres, de la seule corrélation ; « Différence de MNS » s'en sert.</translation>
  </message>
  <message>
   <source>Correlation</source>
   <translation>Corrélation</translation>
  </message>
  <message>
   <source>How alike the photographs are at each cell, up to 1.</source>
   <translation>La ressemblance des photographies en chaque cellule, jusqu'à 1.</translation>
  </message>
  <message>
   <source>Views</source>
   <translation>Vues</translation>
  </message>
  <message>
   <source>How many photographs measured each cell.</source>
   <translation>Combien de photographies ont mesuré chaque cellule.</translation>
  </message>
  <message>
   <source>Filled cells</source>
   <translation>Cellules comblées</translation>
  </message>
  <message>
   <source>1 where the height was interpolated, 0 where it was measured, nodata where there is none.</source>
   <translation>1 où l'altitude a été interpolée, 0 où elle a été mesurée, sans donnée où il n'y en a pas.</translation>
  </message>
  <message>
   <source>Orthophoto</source>
   <translation>Orthophoto</translation>
  </message>
  <message>
   <source>The photographs' colours on the surface, brought to one brightness, from those that look down most steeply.</source>
   <translation>Les couleurs des photographies sur la surface, ramenées à une même luminosité, prises de celles qui regardent le plus à la verticale.</translation>
  </message>
  <message>
   <source>Bits of the orthophoto</source>
   <translation>Bits de l'orthophoto</translation>
  </message>
  <message>
   <source>8: for maps and screens; 16: keeps the fine shades of RAW and 16-bit photographs, at twice the size.</source>
   <translation>8 : pour les cartes et les écrans ; 16 : conserve les nuances fines des photographies RAW et 16 bits, pour une taille double.</translation>
  </message>
  <message>
   <source>Point cloud</source>
   <translation>Nuage de points</translation>
  </message>
  <message>
   <source>The surface as points in a LAZ file, with colour, standard deviation (sigma) and number of photographs (views).</source>
   <translation>La surface sous forme de points dans un fichier LAZ, avec la couleur, l'écart-type (sigma) et le nombre de photographies (views).</translation>
  </message>
  <message>
   <source>LAZ files (*.laz)</source>
   <translation>Fichiers LAZ (*.laz)</translation>
  </message>
  <message>
   <source>Ground pixel (m)</source>
   <translation>Pixel au sol (m)</translation>
  </message>
  <message>
   <source>Cells with a height (%)</source>
   <translation>Cellules avec une hauteur (%)</translation>
  </message>
  <message>
   <source>Median precision (m)</source>
   <translation>Précision médiane (m)</translation>
  </message>
  <message>
   <source>Georeference</source>
   <translation>Géoréférencer</translation>
  </message>
  <message>
   <source>Brings an oriented survey to the ground with control points, with the positions of the photographs, or with both, and says how well: on control points, on check points that took no part, and by leaving each control point out in turn.</source>
   <translation>Rattache un levé orienté au terrain par des points d'appui, par les positions des photographies, ou par les deux, et dit avec quelle qualité : sur les points d'appui, sur des points de contrôle qui n'ont pas servi, et en écartant chaque point d'appui à son tour.</translation>
  </message>
  <message>
   <source>adjustment: tie points, control points and GNSS positions are adjusted together, the camera included, so that the control also mends the shape and every sigma is that of the whole; similarity: shift, rotation and scale alone, the shape that the photographs gave stays.</source>
   <translation>adjustment : points de liaison, points d'appui et positions GNSS sont compensés ensemble, caméra comprise, si bien que l'appui corrige aussi la forme et que chaque écart-type est celui de l'ensemble ; similarity : translation, rotation et échelle seules, la forme issue des photographies reste.</translation>
  </message>
  <message>
   <source>Polygons of sea, swash, vegetation, people or vehicles: tie points on what moves take no part.</source>
   <translation>Polygones de mer, de jet de rive, de végétation, de personnes ou de véhicules : les points de liaison sur ce qui bouge n'interviennent pas.</translation>
  </message>
  <message>
   <source>Projected CRS of the results; empty: the survey's own.</source>
   <translation>SCR projeté des résultats ; vide : celui du levé.</translation>
  </message>
  <message>
   <source>Residuals</source>
   <translation>Résidus</translation>
  </message>
  <message>
   <source>The ground points with their residuals in metres, drawn as arrows.</source>
   <translation>Les points au sol avec leurs résidus en mètres, dessinés en flèches.</translation>
  </message>
  <message>
   <source>Camera positions</source>
   <translation>Positions de l'appareil</translation>
  </message>
  <message>
   <source>Where each photograph was taken from, as computed.</source>
   <translation>D'où chaque photographie a été prise, selon le calcul.</translation>
  </message>
  <message>
   <source>Tie points (point cloud)</source>
   <translation>Points de liaison (nuage de points)</translation>
  </message>
  <message>
   <source>The tie points as a LAZ file in the survey's CRS. After an adjustment each has its own predicted sigma in east, north and height (sigma_e, sigma_n, sigma_u; m), georeferencing included.</source>
   <translation>Les points de liaison dans un fichier LAZ, dans le SCR du levé. Après une compensation, chacun porte son propre écart-type prévu en est, nord et hauteur (sigma_e, sigma_n, sigma_u ; m), géoréférencement compris.</translation>
  </message>
  <message>
   <source>Nothing to georeference with: give GCPS with MARKS, GCP_FILE, or USE_GNSS.</source>
   <translation>Rien pour géoréférencer : donnez GCPS avec MARKS, GCP_FILE, ou USE_GNSS.</translation>
  </message>
  <message>
   <source>Control points</source>
   <translation>Points d'appui</translation>
  </message>
  <message>
   <source>Check points</source>
   <translation>Points de contrôle</translation>
  </message>
  <message>
   <source>Error on control points, plan (m)</source>
   <translation>Erreur sur les points d'appui, planimétrie (m)</translation>
  </message>
  <message>
   <source>Error on control points, height (m)</source>
   <translation>Erreur sur les points d'appui, altimétrie (m)</translation>
  </message>
  <message>
   <source>Error on check points, plan (m)</source>
   <translation>Erreur sur les points de contrôle, planimétrie (m)</translation>
  </message>
  <message>
   <source>Error on check points, height (m)</source>
   <translation>Erreur sur les points de contrôle, altimétrie (m)</translation>
  </message>
  <message>
   <source>Error on points left out, plan (m)</source>
   <translation>Erreur sur les points écartés, planimétrie (m)</translation>
  </message>
  <message>
   <source>Error on points left out, height (m)</source>
   <translation>Erreur sur les points écartés, altimétrie (m)</translation>
  </message>
  <message>
   <source>Residual of the photographs' positions, plan (m)</source>
   <translation>Résidu des positions des photographies, planimétrie (m)</translation>
  </message>
  <message>
   <source>Residual of the photographs' positions, height (m)</source>
   <translation>Résidu des positions des photographies, altimétrie (m)</translation>
  </message>
  <message>
   <source>Doming (m)</source>
   <translation>Effet de dôme (m)</translation>
  </message>
  <message>
   <source>Ground points</source>
   <translation>Points au sol</translation>
  </message>
  <message>
   <source>Points surveyed on the ground: control points and check points.</source>
   <translation>Points levés au sol : points d'appui et points de contrôle.</translation>
  </message>
  <message>
   <source>Field of names</source>
   <translation>Champ des noms</translation>
  </message>
  <message>
   <source>The field that names each ground point.</source>
   <translation>Le champ qui nomme chaque point au sol.</translation>
  </message>
  <message>
   <source>Field of heights</source>
   <translation>Champ des hauteurs</translation>
  </message>
  <message>
   <source>The field with the height; empty: the Z of the points.</source>
   <translation>Le champ qui donne la hauteur ; vide : le Z des points.</translation>
  </message>
  <message>
   <source>Field of roles</source>
   <translation>Champ des rôles</translation>
  </message>
  <message>
   <source>The field that says 'control' (or 'GCP', or nothing) or 'check'. Check points take no part and tell the accuracy.</source>
   <translation>Le champ qui dit « control » (ou « GCP », ou rien) pour un point d'appui, « check » pour un point de contrôle. Les points de contrôle n'entrent pas dans le calcul et en disent l'exactitude.</translation>
  </message>
  <message>
   <source>Accuracy in plan (m)</source>
   <translation>Précision en planimétrie (m)</translation>
  </message>
  <message>
   <source>Standard deviation of the ground points in plan.</source>
   <translation>Écart-type des points au sol en planimétrie.</translation>
  </message>
  <message>
   <source>Accuracy in height (m)</source>
   <translation>Précision en altimétrie (m)</translation>
  </message>
  <message>
   <source>Standard deviation of the ground points in height.</source>
   <translation>Écart-type des points au sol en altimétrie.</translation>
  </message>
  <message>
   <source>Field of accuracy in plan</source>
   <translation>Champ de précision en planimétrie</translation>
  </message>
  <message>
   <source>Where the accuracy differs from point to point.</source>
   <translation>Quand la précision diffère d'un point à l'autre.</translation>
  </message>
  <message>
   <source>Field of accuracy in height</source>
   <translation>Champ de précision en altimétrie</translation>
  </message>
  <message>
   <source>Marks in the photographs</source>
   <translation>Pointés dans les photographies</translation>
  </message>
  <message>
   <source>A table (a CSV will do) with the fields gcp, image, x, y: where each ground point is seen, in pixels from the top-left corner of the photograph.</source>
   <translation>Une table (un CSV suffit) avec les champs gcp, image, x, y : où chaque point au sol est vu, en pixels depuis le coin supérieur gauche de la photographie.</translation>
  </message>
  <message>
   <source>File of ground points and marks</source>
   <translation>Fichier de points et de pointés</translation>
  </message>
  <message>
   <source>Instead of both: OpenDroneMap's gcp_list.txt, Metashape's markers (XML), MicMac's points and image measures, or tables (CSV) of points and of marks. Where points and marks are two files give one, and the other is found in its folder by what it contains; or give both, separated by a semicolon. A file that names no CRS is taken in the survey's.</source>
   <translation>Au lieu des deux : le gcp_list.txt d'OpenDroneMap, les marqueurs de Metashape (XML), les points d'appui et les mesures image de MicMac, ou des tables (CSV) de points et de pointés. Quand points et pointés sont dans deux fichiers, donnez-en un, et l'autre est trouvé dans son dossier par son contenu ; ou donnez les deux, séparés par un point-virgule. Un fichier qui ne nomme pas de SCR est lu dans celui du levé.</translation>
  </message>
  <message>
   <source>Names of ground points that shall only check, separated by commas or semicolons.</source>
   <translation>Noms des points au sol qui ne servent qu'à vérifier, séparés par des virgules ou des points-virgules.</translation>
  </message>
  <message>
   <source>Accuracy of the marks (px)</source>
   <translation>Précision des pointés (px)</translation>
  </message>
  <message>
   <source>Standard deviation of a mark.</source>
   <translation>Écart-type d'un pointé.</translation>
  </message>
  <message>
   <source>Use the positions of the photographs</source>
   <translation>Utiliser les positions des photographies</translation>
  </message>
  <message>
   <source>The photographs' GNSS positions take part, each with the accuracy it claims.</source>
   <translation>Les positions GNSS des photographies participent, chacune avec la précision qu'elle annonce.</translation>
  </message>
  <message>
   <source>Lever arm</source>
   <translation>Bras de levier</translation>
  </message>
  <message>
   <source>From the camera to the GNSS antenna in metres, three numbers: right, forward, up, of the levelled aircraft.</source>
   <translation>De l'antenne GNSS à l'appareil en mètres, trois nombres : droite, avant, haut, de l'aéronef à l'horizontale.</translation>
  </message>
  <message>
   <source>Heights of the ground points</source>
   <translation>Hauteurs des points au sol</translation>
  </message>
  <message>
   <source>What the ground points' heights refer to: the ellipsoid, or mean sea level (orthometric). A compound CRS of the points says it, too.</source>
   <translation>À quoi se rapportent les altitudes des points au sol : l'ellipsoïde, ou le niveau moyen de la mer (orthometric). Un SCR composé des points le dit aussi.</translation>
  </message>
  <message>
   <source>Heights of the photographs</source>
   <translation>Hauteurs des photographies</translation>
  </message>
  <message>
   <source>What the heights of the photographs' positions refer to: the ellipsoid, or mean sea level (orthometric).</source>
   <translation>À quoi se rapportent les hauteurs des positions des photographies : l'ellipsoïde, ou le niveau moyen de la mer (orthometric).</translation>
  </message>
  <message>
   <source>Geoid</source>
   <translation>Géoïde</translation>
  </message>
  <message>
   <source>How far the geoid lies above the ellipsoid: a raster, or one number in metres (about 50 in western France, about -33 in New York). Needed when the two kinds of heights differ.</source>
   <translation>La hauteur du géoïde au-dessus de l'ellipsoïde : un raster, ou un nombre en mètres (environ 50 dans l'ouest de la France, environ -33 à New York). Nécessaire quand les deux sortes d'altitudes diffèrent.</translation>
  </message>
  <message>
   <source>GCPS and GCP_FILE exclude each other: give one of them.</source>
   <translation>GCPS et GCP_FILE s'excluent : donnez l'un des deux.</translation>
  </message>
  <message>
   <source>GCPS need NAME_FIELD: name the field with the points' names.</source>
   <translation>GCPS demande NAME_FIELD : indiquez le champ des noms des points.</translation>
  </message>
  <message>
   <source>GCPS need MARKS: give the table of their places in the photographs.</source>
   <translation>GCPS demande MARKS : donnez la table de leurs places dans les photographies.</translation>
  </message>
  <message>
   <source>Orient photographs</source>
   <translation>Orienter les photographies</translation>
  </message>
  <message>
   <source>Finds from the tie points where each photograph was taken and how the camera draws, in a free frame without scale. 'Georeference' brings the result to the ground.</source>
   <translation>Trouve à partir des points de liaison d'où chaque photographie a été prise et comment l'appareil dessine, dans un repère libre sans échelle. « Géoréférencer » rattache le résultat au terrain.</translation>
  </message>
  <message>
   <source>brown: focal length, principal point, two radial and two tangential terms; radial: focal length, principal point, two radial terms; simple_radial: one radial term; full: with rational radial terms, for wide lenses and many photographs.</source>
   <translation>brown : focale, point principal, deux termes radiaux et deux tangentiels ; radial : focale, point principal, deux termes radiaux ; simple_radial : un terme radial ; full : avec des termes radiaux rationnels, pour les grands-angles et de nombreuses photographies.</translation>
  </message>
  <message>
   <source>Calibration from the survey</source>
   <translation>Calibration reprise du levé</translation>
  </message>
  <message>
   <source>Another survey, already oriented, flown with the same camera and focus: its calibration is used.</source>
   <translation>Un autre levé, déjà orienté, volé avec le même appareil et la même mise au point : sa calibration est reprise.</translation>
  </message>
  <message>
   <source>Use of that calibration</source>
   <translation>Usage de cette calibration</translation>
  </message>
  <message>
   <source>prior: a start that may be refined; fixed: kept as it is.</source>
   <translation>prior : un départ qui peut être affiné ; fixed : gardée telle quelle.</translation>
  </message>
  <message>
   <source>Mapper</source>
   <translation>Reconstruction</translation>
  </message>
  <message>
   <source>incremental: photograph by photograph; global: all at once, quicker on large blocks; auto chooses.</source>
   <translation>incremental : photographie par photographie ; global : toutes à la fois, plus rapide sur de grands blocs ; auto choisit.</translation>
  </message>
  <message>
   <source>The oriented tie points as a LAZ file, in the free frame.</source>
   <translation>Les points de liaison orientés dans un fichier LAZ, dans le repère libre.</translation>
  </message>
  <message>
   <source>Oriented photographs</source>
   <translation>Photographies orientées</translation>
  </message>
  <message>
   <source>Mean tie points per photograph</source>
   <translation>Points de liaison par photographie, en moyenne</translation>
  </message>
  <message>
   <source>Tie points kept (%)</source>
   <translation>Points de liaison conservés (%)</translation>
  </message>
  <message>
   <source>Mean multiple tie points per photograph</source>
   <translation>Points de liaison multiples par photographie, en moyenne</translation>
  </message>
  <message>
   <source>Multiple tie points (%)</source>
   <translation>Points de liaison multiples (%)</translation>
  </message>
  <message>
   <source>Mean residual (px)</source>
   <translation>Résidu moyen (px)</translation>
  </message>
  <message>
   <source>All files (*)</source>
   <translation>Tous les fichiers (*)</translation>
  </message>
  <message>
   <source>The folder that 'Create survey' made. The step adds its files to it.</source>
   <translation>Le dossier que « Créer un levé » a fait. L'étape y ajoute ses fichiers.</translation>
  </message>
  <message>
   <source>noise: features that stand out of each photograph's own noise; fixed: features above one contrast for all photographs, as other programs take them, to compare with.</source>
   <translation>noise : les détails qui ressortent du bruit propre à chaque photographie ; fixed : ceux qui dépassent un même contraste pour toutes les photographies, comme les prennent d'autres logiciels, pour comparer.</translation>
  </message>
  <message>
   <source>Threshold</source>
   <translation>Seuil</translation>
  </message>
  <message>
   <source>How many processes work side by side; 0 is one per processor. Each takes memory: use fewer if it runs short.</source>
   <translation>Combien de processus travaillent côte à côte ; 0 en prend un par processeur. Chacun prend de la mémoire : réduisez-en le nombre si elle manque.</translation>
  </message>
  <message>
   <source>Processes</source>
   <translation>Processus</translation>
  </message>
  <message>
   <source>Address of a Dask scheduler (tcp://host:8786) to spread the work over several computers. The survey must lie where all of them can reach it. Empty: the one in the options, else this computer.</source>
   <translation>Adresse d'un ordonnanceur Dask (tcp://hôte:8786) pour répartir le travail sur plusieurs ordinateurs. Le levé doit être là où tous peuvent l'atteindre. Vide : celui des options, sinon cet ordinateur.</translation>
  </message>
  <message>
   <source>Dask scheduler</source>
   <translation>Ordonnanceur Dask</translation>
  </message>
  <message>
   <source>A page with the step's numbers and pictures, to keep or send.</source>
   <translation>Une page avec les nombres et les images de l'étape, à garder ou à envoyer.</translation>
  </message>
  <message>
   <source>One is always written to the report folder of the survey.</source>
   <translation>Une autre est toujours écrite dans le dossier report du levé.</translation>
  </message>
  <message>
   <source>Report</source>
   <translation>Rapport</translation>
  </message>
  <message>
   <source>HTML files (*.html)</source>
   <translation>Fichiers HTML (*.html)</translation>
  </message>
  <message>
   <source>Predict marks</source>
   <translation>Prédire les pointés</translation>
  </message>
  <message>
   <source>Tells where each ground point appears in which photograph of a georeferenced survey, and how well that is known; painted and coded targets are measured there. The table is what 'Georeference' takes as marks: georeference with the positions of the photographs or with a few marks first, predict, and georeference again.</source>
   <translation>Indique où chaque point au sol apparaît dans quelle photographie d'un levé géoréférencé, et avec quelle précision on le sait ; les cibles peintes et codées y sont mesurées. La table est celle que « Géoréférencer » prend pour pointés : géoréférencez d'abord avec les positions des photographies ou avec quelques pointés, prédisez, puis géoréférencez de nouveau.</translation>
  </message>
  <message>
   <source>Measure the targets</source>
   <translation>Mesurer les cibles</translation>
  </message>
  <message>
   <source>none: predictions only, to be corrected by eye; target: black-and-white targets of four alternating quadrants, or crosses on a plain ground; code: ArUco and AprilTag codes whose number the point's name ends with. Only targets that are found enter the table, the others are named in the report.</source>
   <translation>none : prédictions seules, à corriger à l'œil ; target : cibles noir et blanc à quatre quadrants alternés, ou croix sur un fond uni ; code : codes ArUco et AprilTag dont le numéro termine le nom du point. Seules les cibles trouvées entrent dans la table, les autres sont nommées dans le rapport.</translation>
  </message>
  <message>
   <source>Marks</source>
   <translation>Pointés</translation>
  </message>
  <message>
   <source>A row for each mark: gcp, image, x and y in pixels from the top-left corner, sigma of an axis in pixels, and the score of a target that was found, from 0 to 1.</source>
   <translation>Une ligne par pointé : gcp, image, x et y en pixels depuis le coin supérieur gauche, sigma par axe en pixels, et la note de 0 à 1 d'une cible trouvée.</translation>
  </message>
  <message>
   <source>Ground points with a mark</source>
   <translation>Points au sol pointés</translation>
  </message>
  <message>
   <source>Photographs with a mark</source>
   <translation>Photographies avec un pointé</translation>
  </message>
  <message>
   <source>Marks predicted but not found</source>
   <translation>Pointés prédits mais non trouvés</translation>
  </message>
  <message>
   <source>Beach profiles</source>
   <translation>Profils de plage</translation>
  </message>
  <message>
   <source>Draws the heights along transects at any number of dates and sums the sand above a datum in m3 per metre of beach, its change since the first and the previous date, and the width of the beach, each with its standard deviation. Errors that neighbours or a whole surface share are counted. Gaps are told, never filled.</source>
   <translation>Dessine les hauteurs le long de transects à un nombre quelconque de dates et somme le sable au-dessus d'une cote en m3 par mètre de plage, son changement depuis la première et la précédente date, et la largeur de la plage, chacun avec son écart-type. Les erreurs que des voisins ou toute une surface partagent sont comptées. Les lacunes sont signalées, jamais comblées.</translation>
  </message>
  <message>
   <source>Spacing of points (m)</source>
   <translation>Espacement des points (m)</translation>
  </message>
  <message>
   <source>Along each transect; finer cells are averaged along the line. 0: the coarsest surface's cell.</source>
   <translation>Le long de chaque transect ; des cellules plus fines sont moyennées le long de la ligne. 0 : la cellule de la surface la plus grossière.</translation>
  </message>
  <message>
   <source>From distance (m)</source>
   <translation>À partir de la distance (m)</translation>
  </message>
  <message>
   <source>Sand counts from here on, from the landward end.</source>
   <translation>Le sable compte à partir d'ici, depuis l'extrémité côté terre.</translation>
  </message>
  <message>
   <source>To distance (m)</source>
   <translation>Jusqu'à la distance (m)</translation>
  </message>
  <message>
   <source>Sand counts up to here; empty: to the end of each transect.</source>
   <translation>Le sable compte jusqu'ici ; vide : jusqu'à la fin de chaque transect.</translation>
  </message>
  <message>
   <source>Profiles</source>
   <translation>Profils</translation>
  </message>
  <message>
   <source>Each transect once per date, with sand, change and width, their deviations and intervals.</source>
   <translation>Chaque transect une fois par date, avec sable, changement et largeur, leurs écarts-types et intervalles.</translation>
  </message>
  <message>
   <source>Profile points</source>
   <translation>Points des profils</translation>
  </message>
  <message>
   <source>Transect, date, distance, height and its deviation; gaps are empty.</source>
   <translation>Transect, date, distance, hauteur et son écart-type ; les lacunes sont vides.</translation>
  </message>
  <message>
   <source>Transects</source>
   <translation>Transects</translation>
  </message>
  <message>
   <source>Dates</source>
   <translation>Dates</translation>
  </message>
  <message>
   <source>Mean change from first to last date (m3 per m)</source>
   <translation>Changement moyen de la première à la dernière date (m3 par m)</translation>
  </message>
  <message>
   <source>Deviation of the mean change (m3 per m)</source>
   <translation>Écart-type du changement moyen (m3 par m)</translation>
  </message>
  <message>
   <source>Mean change of width from first to last date (m)</source>
   <translation>Changement moyen de largeur de la première à la dernière date (m)</translation>
  </message>
  <message>
   <source>Mean share of the transects with heights (%)</source>
   <translation>Part moyenne des transects avec des hauteurs (%)</translation>
  </message>
  <message>
   <source>DSMs</source>
   <translation>MNS</translation>
  </message>
  <message>
   <source>Surfaces of several dates, in any order; grids and CRS may differ.</source>
   <translation>Surfaces de plusieurs dates, dans n'importe quel ordre ; grilles et SCR peuvent différer.</translation>
  </message>
  <message>
   <source>One date for each DSM in their order, separated by commas (2018-06-06, 2018-07-13), or some by name (beach.tif=2018-06-06). Empty: the temporal range of the layer, the file's tags, or a date in its name such as 20180606 or 2018-06-06. Two surveys of one day need a time: 2018-06-06T09:30.</source>
   <translation>Une date par MNS dans leur ordre, séparées par des virgules (2018-06-06, 2018-07-13), ou certaines par nom (plage.tif=2018-06-06). Vide : la plage temporelle de la couche, les étiquettes du fichier, ou une date dans son nom comme 20180606 ou 2018-06-06. Deux levés du même jour demandent une heure : 2018-06-06T09:30.</translation>
  </message>
  <message>
   <source>Table of dates</source>
   <translation>Table des dates</translation>
  </message>
  <message>
   <source>Fields file (its name) and date, and sigma in metres where it is known. DATES wins over it, it wins over the names.</source>
   <translation>Champs file (son nom) et date, et sigma en mètres là où il est connu. DATES l'emporte sur elle, elle l'emporte sur les noms.</translation>
  </message>
  <message>
   <source>The value of empty cells in all surfaces, where their files do not say it.</source>
   <translation>La valeur des cellules vides dans toutes les surfaces, là où leurs fichiers ne la disent pas.</translation>
  </message>
  <message>
   <source>Precision rasters</source>
   <translation>Rasters de précision</translation>
  </message>
  <message>
   <source>Standard deviation of each height in metres, from 'Export DSM': one for each DSM, in the same order.</source>
   <translation>Écart-type de chaque hauteur en mètres, tiré de « Exporter le MNS » : un par MNS, dans le même ordre.</translation>
  </message>
  <message>
   <source>Deviation of a height (m)</source>
   <translation>Écart-type d'une hauteur (m)</translation>
  </message>
  <message>
   <source>Standard deviation of the heights of each surface, one number, where there are no precision rasters.</source>
   <translation>Écart-type des hauteurs de chaque surface, un seul nombre, là où il n'y a pas de rasters de précision.</translation>
  </message>
  <message>
   <source>Polygons where nothing changed, such as rock or road: they tell how each date errs against the others.</source>
   <translation>Polygones où rien n'a changé, comme rocher ou route : ils disent comment chaque date se trompe par rapport aux autres.</translation>
  </message>
  <message>
   <source>What of its departure from all dates together, on stable ground, is taken off each date: the level (vertical), a tilted plane (plane), the plane only where chance does not explain it (auto), or nothing (none). Needs STABLE.</source>
   <translation>Ce qui, de son écart à l'ensemble des dates sur le sol stable, est retiré de chaque date : le niveau (vertical), un plan incliné (plane), le plan seulement là où le hasard ne l'explique pas (auto), ou rien (none). Demande STABLE.</translation>
  </message>
  <message>
   <source>Of each surface as a whole; used where neither stable ground nor the DSM's georeferencing can tell.</source>
   <translation>De chaque surface dans son ensemble ; sert là où ni le sol stable ni le géoréférencement du MNS ne peuvent le dire.</translation>
  </message>
  <message>
   <source>Of intervals and of significance, between 0 and 1.</source>
   <translation>Des intervalles et de la signification, entre 0 et 1.</translation>
  </message>
  <message>
   <source>Lines across the beach. Each starts at its landward end and runs to the sea.</source>
   <translation>Lignes à travers la plage. Chacune commence à son extrémité côté terre et va vers la mer.</translation>
  </message>
  <message>
   <source>Field of transect names</source>
   <translation>Champ des noms des transects</translation>
  </message>
  <message>
   <source>Transects start at the sea</source>
   <translation>Les transects commencent à la mer</translation>
  </message>
  <message>
   <source>Takes the end of each line as its landward end.</source>
   <translation>Prend la fin de chaque ligne comme son extrémité côté terre.</translation>
  </message>
  <message>
   <source>Datum (m)</source>
   <translation>Cote (m)</translation>
  </message>
  <message>
   <source>Height in metres above the DSMs' own zero, also where these are in feet; above the water of every date.</source>
   <translation>Hauteur en mètres au-dessus du zéro des MNS eux-mêmes, même s'ils sont en pieds ; au-dessus de l'eau de chaque date.</translation>
  </message>
  <message>
   <source>Scale of slopes (m)</source>
   <translation>Échelle des pentes (m)</translation>
  </message>
  <message>
   <source>The slope by which heights become distances, of a robust plane over this length. 0: 5 cells, 5 m at least.</source>
   <translation>La pente par laquelle des hauteurs deviennent des distances, d'un plan robuste sur cette longueur. 0 : 5 cellules, 5 m au moins.</translation>
  </message>
  <message>
   <source>All surfaces are brought to cells of this size, finer ones by their mean. 0: the coarsest surface's own cells.</source>
   <translation>Toutes les surfaces sont ramenées à des cellules de cette taille, les plus fines par leur moyenne. 0 : les cellules de la surface la plus grossière.</translation>
  </message>
  <message>
   <source>Shorelines</source>
   <translation>Traits de côte</translation>
  </message>
  <message>
   <source>Traces the contour of each date's surface at a datum. How far it may lie beside is the deviation of the height divided by the slope. Along transects it gives the positions, their movement with its interval, and rates as DSAS names them: NSM net movement, SCE envelope, EPR end point rate, LRR and WLR linear regression, plain and weighted. Seaward is positive.</source>
   <translation>Trace le contour de la surface de chaque date à une cote. Jusqu'où il peut se trouver à côté est l'écart-type de la hauteur divisé par la pente. Le long de transects, il donne les positions, leur mouvement avec son intervalle, et les vitesses comme DSAS les nomme : NSM mouvement net, SCE enveloppe, EPR vitesse entre extrémités, LRR et WLR régression linéaire, simple et pondérée. Vers la mer est positif.</translation>
  </message>
  <message>
   <source>Least length (m)</source>
   <translation>Longueur minimale (m)</translation>
  </message>
  <message>
   <source>Shorter pieces of contour, such as puddles and stones, are left out.</source>
   <translation>Les morceaux de contour plus courts, comme flaques et pierres, sont écartés.</translation>
  </message>
  <message>
   <source>Pieces to keep</source>
   <translation>Morceaux à garder</translation>
  </message>
  <message>
   <source>All that are long enough (all), one per date (longest), or those that a transect meets most seaward (seaward). Positions are always the most seaward ones on what is kept.</source>
   <translation>Tous ceux qui sont assez longs (all), un par date (longest), ou ceux qu'un transect rencontre le plus au large (seaward). Les positions sont toujours les plus au large sur ce qui est gardé.</translation>
  </message>
  <message>
   <source>One line per date, with its slope and how far it may lie beside.</source>
   <translation>Une ligne par date, avec sa pente et jusqu'où elle peut se trouver à côté.</translation>
  </message>
  <message>
   <source>Shore positions</source>
   <translation>Positions du trait de côte</translation>
  </message>
  <message>
   <source>Where each transect meets each date's shoreline, with movement and deviations.</source>
   <translation>Où chaque transect rencontre le trait de côte de chaque date, avec mouvement et écarts-types.</translation>
  </message>
  <message>
   <source>Shoreline rates</source>
   <translation>Vitesses du trait de côte</translation>
  </message>
  <message>
   <source>The transects with NSM, SCE, EPR, LRR and WLR, their deviations and intervals.</source>
   <translation>Les transects avec NSM, SCE, EPR, LRR et WLR, leurs écarts-types et intervalles.</translation>
  </message>
  <message>
   <source>Mean net movement (m)</source>
   <translation>Mouvement net moyen (m)</translation>
  </message>
  <message>
   <source>Mean weighted rate (m per year)</source>
   <translation>Vitesse pondérée moyenne (m par an)</translation>
  </message>
  <message>
   <source>Median deviation across the shore (m)</source>
   <translation>Écart-type médian en travers du trait de côte (m)</translation>
  </message>
  <message>
   <source>Simulate survey</source>
   <translation>Simuler un levé</translation>
  </message>
  <message>
   <source>Renders the photographs of a flight over an invented beach, each as RAW and as JPG, with ground points, marks, zones, and the true surfaces and volumes: to learn the steps, to plan a flight, or to see what to expect of it.</source>
   <translation>Calcule les photographies d'un vol au-dessus d'une plage inventée, chacune en RAW et en JPG, avec points au sol, pointés, zones, et les surfaces et volumes vrais : pour apprendre les étapes, préparer un vol, ou voir ce qu'on peut en attendre.</translation>
  </message>
  <message>
   <source>two: the beach before and after a storm, with the true volumes; one: before only.</source>
   <translation>two : la plage avant et après une tempête, avec les volumes vrais ; one : avant seulement.</translation>
  </message>
  <message>
   <source>Length (m)</source>
   <translation>Longueur (m)</translation>
  </message>
  <message>
   <source>Of the beach, along the shore.</source>
   <translation>De la plage, le long du rivage.</translation>
  </message>
  <message>
   <source>Width (m)</source>
   <translation>Largeur (m)</translation>
  </message>
  <message>
   <source>Of the beach, across the shore.</source>
   <translation>De la plage, en travers du rivage.</translation>
  </message>
  <message>
   <source>CRS</source>
   <translation>SCR</translation>
  </message>
  <message>
   <source>A projected CRS in metres; empty: one is chosen.</source>
   <translation>Un SCR projeté en mètres ; vide : il est choisi.</translation>
  </message>
  <message>
   <source>Flying height (m)</source>
   <translation>Hauteur de vol (m)</translation>
  </message>
  <message>
   <source>Above the beach.</source>
   <translation>Au-dessus de la plage.</translation>
  </message>
  <message>
   <source>Forward overlap (%)</source>
   <translation>Recouvrement longitudinal (%)</translation>
  </message>
  <message>
   <source>Of one photograph with the next.</source>
   <translation>D'une photographie avec la suivante.</translation>
  </message>
  <message>
   <source>Side overlap (%)</source>
   <translation>Recouvrement latéral (%)</translation>
  </message>
  <message>
   <source>Of one strip with the next.</source>
   <translation>D'une bande avec la suivante.</translation>
  </message>
  <message>
   <source>Tilt (degrees)</source>
   <translation>Inclinaison (degrés)</translation>
  </message>
  <message>
   <source>Standard deviation of the camera's lean from plumb.</source>
   <translation>Écart-type de l'inclinaison de l'appareil par rapport à la verticale.</translation>
  </message>
  <message>
   <source>Image width (px)</source>
   <translation>Largeur de l'image (px)</translation>
  </message>
  <message>
   <source>Pixels across.</source>
   <translation>Pixels en largeur.</translation>
  </message>
  <message>
   <source>Image height (px)</source>
   <translation>Hauteur de l'image (px)</translation>
  </message>
  <message>
   <source>Pixels down.</source>
   <translation>Pixels en hauteur.</translation>
  </message>
  <message>
   <source>Focal length (px)</source>
   <translation>Focale (px)</translation>
  </message>
  <message>
   <source>Of the camera, in pixels.</source>
   <translation>De l'appareil, en pixels.</translation>
  </message>
  <message>
   <source>Contrast</source>
   <translation>Contraste</translation>
  </message>
  <message>
   <source>Standard deviation of the sand's own brightness relative to its mean, over features from 2 cm to 3 m: 0.04 is common, 0.012 very bare. Slopes and ripples add their shading.</source>
   <translation>Écart type de la clarté propre du sable rapporté à sa moyenne, pour des détails de 2 cm à 3 m : 0,04 est courant, 0,012 très nu. Pentes et rides ajoutent leur ombrage.</translation>
  </message>
  <message>
   <source>Noise</source>
   <translation>Bruit</translation>
  </message>
  <message>
   <source>Of light and sensor: 1 is a small drone camera at its lowest ISO, 0 is none.</source>
   <translation>De la lumière et du capteur : 1 est un petit appareil de drone à sa sensibilité la plus basse, 0 aucun.</translation>
  </message>
  <message>
   <source>GNSS accuracy in plan (m)</source>
   <translation>Précision GNSS en planimétrie (m)</translation>
  </message>
  <message>
   <source>Of the photographs' positions.</source>
   <translation>Des positions des photographies.</translation>
  </message>
  <message>
   <source>GNSS accuracy in height (m)</source>
   <translation>Précision GNSS en altimétrie (m)</translation>
  </message>
  <message>
   <source>Accuracy of ground points in plan (m)</source>
   <translation>Précision des points au sol en planimétrie (m)</translation>
  </message>
  <message>
   <source>Of their survey.</source>
   <translation>De leur lever.</translation>
  </message>
  <message>
   <source>Accuracy of ground points in height (m)</source>
   <translation>Précision des points au sol en altitude (m)</translation>
  </message>
  <message>
   <source>Targets laid out as control points.</source>
   <translation>Cibles posées comme points d'appui.</translation>
  </message>
  <message>
   <source>Targets laid out as check points.</source>
   <translation>Cibles posées comme points de contrôle.</translation>
  </message>
  <message>
   <source>Seed</source>
   <translation>Graine</translation>
  </message>
  <message>
   <source>The same number gives the same survey.</source>
   <translation>Le même nombre donne le même levé.</translation>
  </message>
  <message>
   <source>Folder</source>
   <translation>Dossier</translation>
  </message>
  <message>
   <source>Folder to make, with photographs (jpg, raw), ground points, marks, zones and truth.</source>
   <translation>Dossier à créer, avec photographies (jpg, raw), points au sol, pointés, zones et vérité.</translation>
  </message>
  <message>
   <source>Photographs per date</source>
   <translation>Photographies par date</translation>
  </message>
  <message>
   <source>Deviation of heights to expect (m)</source>
   <translation>Écart-type des hauteurs à attendre (m)</translation>
  </message>
  <message>
   <source>True erosion (m3)</source>
   <translation>Érosion vraie (m3)</translation>
  </message>
  <message>
   <source>True deposition (m3)</source>
   <translation>Dépôt vrai (m3)</translation>
  </message>
  <message>
   <source>True net volume (m3)</source>
   <translation>Volume net vrai (m3)</translation>
  </message>
  <message>
   <source>{} and more</source>
   <translation>{} et plus</translation>
  </message>
  <message>
   <source>measured</source>
   <translation>mesurée</translation>
  </message>
  <message>
   <source>interpolated</source>
   <translation>interpolée</translation>
  </message>
  <message>
   <source>Survey layers</source>
   <translation>Couches du levé</translation>
  </message>
  <message>
   <source>Writes where the photographs of a survey were taken, what ground each shows, and its tie points as layers. A survey that is not georeferenced yet gives the GNSS positions alone.</source>
   <translation>Écrit en couches d'où les photographies d'un levé ont été prises, quel terrain chacune montre, et ses points de liaison. Un levé qui n'est pas encore géoréférencé ne donne que les positions GNSS.</translation>
  </message>
  <message>
   <source>Most tie points</source>
   <translation>Nombre maximal de points de liaison</translation>
  </message>
  <message>
   <source>So many tie points are written at most, evenly chosen among all; 0 writes all of them.</source>
   <translation>On écrit au plus ce nombre de points de liaison, choisis régulièrement parmi tous ; 0 les écrit tous.</translation>
  </message>
  <message>
   <source>Where each photograph was taken, with its file and a small picture of it.</source>
   <translation>D'où chaque photographie a été prise, avec son fichier et une vignette.</translation>
  </message>
  <message>
   <source>Footprints</source>
   <translation>Emprises</translation>
  </message>
  <message>
   <source>What each photograph shows of a level at the median height of its tie points.</source>
   <translation>Ce que chaque photographie montre d'un plan horizontal à la hauteur médiane de ses points de liaison.</translation>
  </message>
  <message>
   <source>Tie points</source>
   <translation>Points de liaison</translation>
  </message>
  <message>
   <source>Tie points with their height (m), the number of photographs that show each, and its residual (px).</source>
   <translation>Les points de liaison avec leur hauteur (m), le nombre de photographies qui les montrent et leur résidu (px).</translation>
  </message>
  <message>
   <source>Tie points written</source>
   <translation>Points de liaison écrits</translation>
  </message>
  <message>
   <source>Tie points of the survey</source>
   <translation>Points de liaison du levé</translation>
  </message>
  <message>
   <source>Find tie points</source>
   <translation>Chercher les points de liaison</translation>
  </message>
  <message>
   <source>Finds features in the photographs and matches them between overlapping ones. What agrees with one geometry is laid on each other to a fraction of a pixel by least-squares matching, and kept in features.db, a COLMAP database.</source>
   <translation>Cherche des détails dans les photographies et les apparie entre celles qui se recouvrent. Ce qui s'accorde avec une géométrie est superposé à une fraction de pixel par appariement par moindres carrés, et gardé dans features.db, une base de données COLMAP.</translation>
  </message>
  <message>
   <source>Images</source>
   <translation>Images</translation>
  </message>
  <message>
   <source>auto: the enhanced images if they exist, else the originals with a warning; enhanced; original.</source>
   <translation>auto : les images rehaussées si elles existent, sinon les originales avec un avertissement ; enhanced : rehaussées ; original : originales.</translation>
  </message>
  <message>
   <source>Most features per photograph</source>
   <translation>Détails par photographie, au plus</translation>
  </message>
  <message>
   <source>The strongest features are kept, this many of each photograph; 0 is no limit.</source>
   <translation>Les détails les plus forts sont gardés, autant pour chaque photographie ; 0 est sans limite.</translation>
  </message>
  <message>
   <source>Pairs</source>
   <translation>Paires</translation>
  </message>
  <message>
   <source>auto: neighbours by position; without positions every pair of up to 60 photographs, beyond these neighbours in the order of the flight and those that look most alike. exhaustive: every pair; sequential: neighbours in the order of the flight, which ties neighbouring strips in few places. Pairs that matched ones point to are added.</source>
   <translation>auto : les voisines selon la position ; sans positions, toutes les paires jusqu'à 60 photographies, au-delà les voisines dans l'ordre du vol et celles qui se ressemblent le plus. exhaustive : toutes les paires ; sequential : les voisines dans l'ordre du vol, ce qui lie les bandes voisines en peu d'endroits. Les paires que d'autres appariées désignent sont ajoutées.</translation>
  </message>
  <message>
   <source>Mean features per photograph</source>
   <translation>Détails par photographie, en moyenne</translation>
  </message>
  <message>
   <source>Verified pairs</source>
   <translation>Paires vérifiées</translation>
  </message>
  <message>
   <source>Verified matches</source>
   <translation>Appariements vérifiés</translation>
  </message>
  <message>
   <source>Volumes through time</source>
   <translation>Volumes au fil du temps</translation>
  </message>
  <message>
   <source>Sums the volume of each zone date by date, over the ground that has a height at every date, with the change since the first and since the previous date and their intervals. Errors are kept per date, so that changes which share a date are not taken for independent. Maps the linear rate of each cell and where it is significant; rates need three dates.</source>
   <translation>Somme le volume de chaque zone date par date, sur le sol qui a une hauteur à chaque date, avec le changement depuis la première et depuis la précédente date et leurs intervalles. Les erreurs sont tenues par date, de sorte que des changements qui partagent une date ne sont pas pris pour indépendants. Cartographie la vitesse linéaire de chaque cellule et où elle est significative ; les vitesses demandent trois dates.</translation>
  </message>
  <message>
   <source>Polygons to sum volumes in; empty: the overlap of all surfaces.</source>
   <translation>Polygones où sommer les volumes ; vide : le recouvrement de toutes les surfaces.</translation>
  </message>
  <message>
   <source>Volumes by date</source>
   <translation>Volumes par date</translation>
  </message>
  <message>
   <source>One row per zone and date: volumes in m3, deviations, intervals.</source>
   <translation>Une ligne par zone et date : volumes en m3, écarts-types, intervalles.</translation>
  </message>
  <message>
   <source>Zone rates</source>
   <translation>Vitesses des zones</translation>
  </message>
  <message>
   <source>The zones with their change from first to last date and their rate in m3 per year.</source>
   <translation>Les zones avec leur changement de la première à la dernière date et leur vitesse en m3 par an.</translation>
  </message>
  <message>
   <source>Rate</source>
   <translation>Vitesse</translation>
  </message>
  <message>
   <source>Metres per year of each cell with heights at three dates or more.</source>
   <translation>Mètres par an de chaque cellule qui a des hauteurs à trois dates au moins.</translation>
  </message>
  <message>
   <source>Significant rate</source>
   <translation>Vitesse significative</translation>
  </message>
  <message>
   <source>The rate where its interval leaves zero out.</source>
   <translation>La vitesse là où son intervalle exclut zéro.</translation>
  </message>
  <message>
   <source>Net volume from first to last date (m3)</source>
   <translation>Volume net de la première à la dernière date (m3)</translation>
  </message>
  <message>
   <source>Rate (m3 per year)</source>
   <translation>Vitesse (m3 par an)</translation>
  </message>
  <message>
   <source>Deviation of the rate (m3 per year)</source>
   <translation>Écart-type de la vitesse (m3 par an)</translation>
  </message>
  <message>
   <source>Area with heights at every date (%)</source>
   <translation>Surface avec des hauteurs à chaque date (%)</translation>
  </message>
  <message>
   <source>The engine's Python {} cannot be started: {}.</source>
   <translation>Le Python du moteur {} ne peut être lancé : {}.</translation>
  </message>
  <message>
   <source>This is a fault of Strandline in '{}': {}; please report it with the lines above (also in {}).</source>
   <translation>C'est une faute de Strandline dans « {} » : {} ; merci de la signaler avec les lignes ci-dessus (aussi dans {}).</translation>
  </message>
  <message>
   <source>The engine was killed ({}) during '{}', most often for want of memory: use fewer WORKERS; its log is {}.</source>
   <translation>Le moteur a été arrêté ({}) pendant « {} », le plus souvent faute de mémoire : réduisez WORKERS ; son journal est {}.</translation>
  </message>
  <message>
   <source>The engine crashed ({}) during '{}': its last lines stand above, its whole log is {}.</source>
   <translation>Le moteur s'est effondré ({}) pendant « {} » : ses dernières lignes sont ci-dessus, son journal entier est {}.</translation>
  </message>
  <message>
   <source>signal {}</source>
   <translation>signal {}</translation>
  </message>
  <message>
   <source>exit status {}</source>
   <translation>code de sortie {}</translation>
  </message>
  <message>
   <source>The option 'Python of the engine'</source>
   <translation>L'option « Python du moteur »</translation>
  </message>
  <message>
   <source>{} names {}, which is not there: correct or remove it.</source>
   <translation>{} indique {}, qui n'existe pas : corrigez-le ou retirez-le.</translation>
  </message>
  <message>
   <source>The engine in {} was made for another version of Strandline: {}.</source>
   <translation>Le moteur dans {} a été fait pour une autre version de Strandline : {}.</translation>
  </message>
  <message>
   <source>The engine of Strandline is not installed: {}.</source>
   <translation>Le moteur de Strandline n'est pas installé : {}.</translation>
  </message>
  <message>
   <source>{} cannot make the engine: PYTHON must be a Python of at least 3.11 with the modules venv and ensurepip.</source>
   <translation>{} ne peut créer le moteur : PYTHON doit être un Python 3.11 ou plus récent avec les modules venv et ensurepip.</translation>
  </message>
  <message>
   <source>No Python of at least 3.11 with the module venv was found: install one (on Debian: apt install python3-venv), or name it in PYTHON.</source>
   <translation>Aucun Python 3.11 ou plus récent avec le module venv n'a été trouvé : installez-en un (sous Debian : apt install python3-venv), ou indiquez-le dans PYTHON.</translation>
  </message>
  <message>
   <source>run `make setup` in {}, or strandline:checkengine with INSTALL=true</source>
   <translation>lancez `make setup` dans {}, ou strandline:checkengine avec INSTALL=true</translation>
  </message>
  <message>
   <source>run strandline:checkengine ('Check engine') with INSTALL=true</source>
   <translation>lancez strandline:checkengine (« Vérifier le moteur ») avec INSTALL=true</translation>
  </message>
  <message>
   <source>The raster {} is not a file (it comes from '{}'): save it as a GeoTIFF first.</source>
   <translation>Le raster {} n'est pas un fichier (il vient de « {} ») : enregistrez-le d'abord en GeoTIFF.</translation>
  </message>
  <message>
   <source>The engine's layer {} cannot be read.</source>
   <translation>La couche {} du moteur ne peut être lue.</translation>
  </message>
  <message>
   <source>The layer {} cannot be written: {}.</source>
   <translation>La couche {} ne peut être écrite : {}.</translation>
  </message>
  <message>
   <source>The field {} of {} cannot be handed to the engine: rename it.</source>
   <translation>Le champ {} de {} ne peut être transmis au moteur : renommez-le.</translation>
  </message>
  <message>
   <source>The feature {} of {} cannot be handed to the engine.</source>
   <translation>L'entité {} de {} ne peut être transmise au moteur.</translation>
  </message>
  <message>
   <source>{} cannot be loaded as rasters: {}.</source>
   <translation>{} ne peuvent être chargés comme rasters : {}.</translation>
  </message>
  <message>
   <source>{} is not a CRS that QGIS knows: {}.</source>
   <translation>{} n'est pas un SCR que QGIS connaît : {}.</translation>
  </message>
  <message>
   <source>The option 'Processes'</source>
   <translation>L'option « Processus »</translation>
  </message>
  <message>
   <source>{} is '{}': it must be a whole number, 0 for one process per processor.</source>
   <translation>{} vaut « {} » : il faut un nombre entier, 0 pour un processus par processeur.</translation>
  </message>
  <message>
   <source>The survey {} cannot be read: {}.</source>
   <translation>Le levé {} ne peut pas être lu : {}.</translation>
  </message>
  <message>
   <source>Something is still running: wait for it or cancel it.</source>
   <translation>Une tâche est encore en cours : attendez-la ou annulez-la.</translation>
  </message>
  <message>
   <source>{} cannot be started.</source>
   <translation>{} ne peut pas être lancé.</translation>
  </message>
  <message>
   <source>It failed without a word.</source>
   <translation>Échec sans message.</translation>
  </message>
  <message>
   <source>A table with the fields gcp, image, x, y, in pixels from the top-left corner.</source>
   <translation>Une table avec les champs gcp, image, x, y, en pixels depuis le coin supérieur gauche.</translation>
  </message>
  <message>
   <source>New...</source>
   <translation>Nouvelle...</translation>
  </message>
  <message>
   <source>Make an empty table of marks, or open one that is there.</source>
   <translation>Créer une table de pointés vide, ou en ouvrir une qui existe.</translation>
  </message>
  <message>
   <source>Without a field the height is the Z of the geometry.</source>
   <translation>Sans champ, la hauteur est le Z de la géométrie.</translation>
  </message>
  <message>
   <source>Which points are control and which only check.</source>
   <translation>Quels points servent d'appui et lesquels ne servent qu'au contrôle.</translation>
  </message>
  <message>
   <source>{} is not a table of marks: it needs the fields gcp, image, x and y.</source>
   <translation>{} n'est pas une table de pointés : il lui faut les champs gcp, image, x et y.</translation>
  </message>
  <message>
   <source>GeoPackage (*.gpkg);;Comma-separated values (*.csv)</source>
   <translation>GeoPackage (*.gpkg);;Valeurs séparées par des virgules (*.csv)</translation>
  </message>
  <message>
   <source>Table of marks</source>
   <translation>Table de pointés</translation>
  </message>
  <message>
   <source>Survey</source>
   <translation>Levé</translation>
  </message>
  <message>
   <source>Name, height</source>
   <translation>Nom, hauteur</translation>
  </message>
  <message>
   <source>Role</source>
   <translation>Rôle</translation>
  </message>
  <message>
   <source>Sigmas</source>
   <translation>Écarts-types</translation>
  </message>
  <message>
   <source>Mark ground points</source>
   <translation>Pointer les points au sol</translation>
  </message>
  <message>
   <source>Add survey to map...</source>
   <translation>Ajouter un levé à la carte...</translation>
  </message>
  <message>
   <source>The survey is in the map.</source>
   <translation>Le levé est dans la carte.</translation>
  </message>
  <message>
   <source>Predict</source>
   <translation>Prédire</translation>
  </message>
  <message>
   <source>Compute where each point should be seen in which photograph</source>
   <translation>Calculer où chaque point devrait se voir dans quelle photographie</translation>
  </message>
  <message>
   <source>Measure</source>
   <translation>Mesurer</translation>
  </message>
  <message>
   <source>Look for painted targets where points are predicted, and measure them</source>
   <translation>Chercher les cibles peintes là où les points sont prédits, et les mesurer</translation>
  </message>
  <message>
   <source>Adjust</source>
   <translation>Compenser</translation>
  </message>
  <message>
   <source>Georeference the survey with these marks, then show the residuals</source>
   <translation>Géoréférencer le levé avec ces pointés, puis montrer les résidus</translation>
  </message>
  <message>
   <source>To map</source>
   <translation>Vers la carte</translation>
  </message>
  <message>
   <source>Add the survey's photographs, tie points, residuals and surface to the map</source>
   <translation>Ajouter à la carte les photographies, les points de liaison, les résidus et la surface du levé</translation>
  </message>
  <message>
   <source>Undo (Ctrl+Z)</source>
   <translation>Annuler la dernière action (Ctrl+Z)</translation>
  </message>
  <message>
   <source>Redo (Ctrl+Shift+Z)</source>
   <translation>Rétablir (Ctrl+Maj+Z)</translation>
  </message>
  <message>
   <source>Cancel</source>
   <translation>Annuler</translation>
  </message>
  <message>
   <source>Stop what is running</source>
   <translation>Arrêter ce qui est en cours</translation>
  </message>
  <message>
   <source>Choose the layer of ground points, the field of their names, and the table of marks.</source>
   <translation>Choisissez la couche des points au sol, le champ de leurs noms et la table de pointés.</translation>
  </message>
  <message>
   <source>Choose the survey folder to begin.</source>
   <translation>Choisissez le dossier du levé pour commencer.</translation>
  </message>
  <message>
   <source>The survey is not oriented yet: run 'Orient' first. Until then all photographs are listed.</source>
   <translation>Le levé n'est pas encore orienté : lancez d'abord « Orienter ». En attendant, toutes les photographies sont listées.</translation>
  </message>
  <message>
   <source>Nothing tells where the photographs were taken: mark three points in two photographs each, then adjust.</source>
   <translation>Rien n'indique d'où les photographies ont été prises : pointez trois points dans deux photographies chacun, puis compensez.</translation>
  </message>
  <message>
   <source>Choose a point in the list first.</source>
   <translation>Choisissez d'abord un point dans la liste.</translation>
  </message>
  <message>
   <source>There are no marks yet: mark points in the photographs first.</source>
   <translation>Il n'y a pas encore de pointés : pointez d'abord des points dans les photographies.</translation>
  </message>
  <message>
   <source>The areas that the last georeferencing ignored are not: use 'Adjust with...' for that.</source>
   <translation>Les zones que le dernier géoréférencement ignorait ne le sont pas : pour cela, utilisez « Compenser avec... ».</translation>
  </message>
  <message>
   <source>This is the first.</source>
   <translation>C'est la première.</translation>
  </message>
  <message>
   <source>This is the last.</source>
   <translation>C'est la dernière.</translation>
  </message>
  <message>
   <source>{} targets were measured, {} were not found.</source>
   <translation>{} cibles ont été mesurées, {} n'ont pas été trouvées.</translation>
  </message>
  <message>
   <source>{} marks by eye lie more than 3 px from them and stay.</source>
   <translation>{} pointés à l'œil en sont à plus de 3 px et restent.</translation>
  </message>
  <message>
   <source>The residuals cannot be kept for the map: {}.</source>
   <translation>Les résidus ne peuvent pas être gardés pour la carte : {}.</translation>
  </message>
  <message>
   <source>Control: {} in plan, {} in height. Check: {}, {}.</source>
   <translation>Appui : {} en plan, {} en hauteur. Contrôle : {}, {}.</translation>
  </message>
  <message>
   <source>No point of the layer has a name: choose the field of the names.</source>
   <translation>Aucun point de la couche n'a de nom : choisissez le champ des noms.</translation>
  </message>
  <message>
   <source>The georeferencing is older than the orientation: adjust again.</source>
   <translation>Le géoréférencement est plus ancien que l'orientation : compensez de nouveau.</translation>
  </message>
  <message>
   <source>Nothing is georeferenced yet: all photographs are listed, the nearest first. 'Predict' does it by GNSS.</source>
   <translation>Rien n'est encore géoréférencé : toutes les photographies sont listées, les plus proches d'abord. « Prédire » le fait par GNSS.</translation>
  </message>
  <message>
   <source>{} rows of the table name no point or photograph, are not complete, or stand twice: {}.</source>
   <translation>{} lignes de la table ne nomment ni point ni photographie, sont incomplètes ou en double : {}.</translation>
  </message>
  <message>
   <source>Survey, points and marks</source>
   <translation>Levé, points et pointés</translation>
  </message>
  <message>
   <source>Targets of this point</source>
   <translation>Cibles de ce point</translation>
  </message>
  <message>
   <source>Targets of all points</source>
   <translation>Cibles de tous les points</translation>
  </message>
  <message>
   <source>Adjust with...</source>
   <translation>Compenser avec...</translation>
  </message>
  <message>
   <source>none</source>
   <translation>aucun</translation>
  </message>
  <message>
   <source>Ready: {}</source>
   <translation>Prêt : {}</translation>
  </message>
  <message>
   <source>The engine was removed from the profile.</source>
   <translation>Le moteur a été supprimé du profil.</translation>
  </message>
  <message>
   <source>The engine could not be removed whole: {}.</source>
   <translation>Le moteur n'a pas pu être supprimé en entier : {}.</translation>
  </message>
  <message>
   <source>The engine works.</source>
   <translation>Le moteur fonctionne.</translation>
  </message>
  <message>
   <source>move the mark of {}</source>
   <translation>déplacer le pointé de {}</translation>
  </message>
  <message>
   <source>mark {}</source>
   <translation>pointer {}</translation>
  </message>
  <message>
   <source>remove the mark of {}</source>
   <translation>supprimer le pointé de {}</translation>
  </message>
  <message>
   <source>measure {} targets</source>
   <translation>mesurer {} cibles</translation>
  </message>
  <message>
   <source>{} is there already.</source>
   <translation>{} existe déjà.</translation>
  </message>
  <message>
   <source>it cannot be created there</source>
   <translation>elle ne peut pas être créée à cet endroit</translation>
  </message>
  <message>
   <source>The table of marks {} cannot be made: {}.</source>
   <translation>La table de pointés {} ne peut pas être créée : {}.</translation>
  </message>
  <message>
   <source>The table {} has no field {}: marks need gcp, image, x and y.</source>
   <translation>La table {} n'a pas de champ {} : les pointés ont besoin de gcp, image, x et y.</translation>
  </message>
  <message>
   <source>The table {} cannot be edited: save it as a GeoPackage first.</source>
   <translation>La table {} ne peut pas être modifiée : enregistrez-la d'abord en GeoPackage.</translation>
  </message>
  <message>
   <source>The table {} cannot be written: {}</source>
   <translation>La table {} ne peut pas être écrite : {}</translation>
  </message>
  <message>
   <source>Check</source>
   <translation>Vérifier</translation>
  </message>
  <message>
   <source>Remove...</source>
   <translation>Supprimer...</translation>
  </message>
  <message>
   <source>the one that 'Install' makes</source>
   <translation>celui que « Installer » crée</translation>
  </message>
  <message>
   <source>none: packages come from the network</source>
   <translation>aucun : les paquets viennent du réseau</translation>
  </message>
  <message>
   <source>one per processor</source>
   <translation>un par processeur</translation>
  </message>
  <message>
   <source>Each process takes memory: use fewer if it runs short.</source>
   <translation>Chaque processus prend de la mémoire : réduisez leur nombre si elle manque.</translation>
  </message>
  <message>
   <source>none: this computer</source>
   <translation>aucun : cet ordinateur</translation>
  </message>
  <message>
   <source>Update</source>
   <translation>Mettre à jour</translation>
  </message>
  <message>
   <source>Remove the engine in {}? It can be installed again.</source>
   <translation>Supprimer le moteur dans {} ? On peut le réinstaller.</translation>
  </message>
  <message>
   <source>Engine</source>
   <translation>Moteur</translation>
  </message>
  <message>
   <source>Strandline computes in a Python of its own, outside QGIS.</source>
   <translation>Strandline calcule dans un Python à lui, hors de QGIS.</translation>
  </message>
  <message>
   <source>State</source>
   <translation>État</translation>
  </message>
  <message>
   <source>Python of the engine</source>
   <translation>Python du moteur</translation>
  </message>
  <message>
   <source>Work</source>
   <translation>Travail</translation>
  </message>
  <message>
   <source>Environment variables ({}) come before these options, an algorithm's parameters before both.</source>
   <translation>Les variables d'environnement ({}) passent avant ces options, les paramètres d'un algorithme avant les deux.</translation>
  </message>
  <message>
   <source>{} ({} says {})</source>
   <translation>{} ({} vaut {})</translation>
  </message>
  <message>
   <source>Previous photograph (P)</source>
   <translation>Photographie précédente (P)</translation>
  </message>
  <message>
   <source>Next photograph (N)</source>
   <translation>Photographie suivante (N)</translation>
  </message>
  <message>
   <source>Skip</source>
   <translation>Passer</translation>
  </message>
  <message>
   <source>The point cannot be seen here: go on to the next that is not marked (S)</source>
   <translation>Le point ne se voit pas ici : aller au prochain qui n'est pas pointé (S)</translation>
  </message>
  <message>
   <source>Delete</source>
   <translation>Supprimer</translation>
  </message>
  <message>
   <source>Delete the mark (Del)</source>
   <translation>Supprimer le pointé (Suppr)</translation>
  </message>
  <message>
   <source>All</source>
   <translation>Tout</translation>
  </message>
  <message>
   <source>Show all of the photograph (F)</source>
   <translation>Montrer toute la photographie (F)</translation>
  </message>
  <message>
   <source>Enhanced</source>
   <translation>Rehaussée</translation>
  </message>
  <message>
   <source>Show the enhanced image in place of the photograph (E)</source>
   <translation>Montrer l'image rehaussée à la place de la photographie (E)</translation>
  </message>
  <message>
   <source>Choose a photograph of a point in the list.</source>
   <translation>Choisissez une photographie d'un point dans la liste.</translation>
  </message>
  <message>
   <source>There is no enhanced image of {}: run 'Enhance'.</source>
   <translation>Il n'y a pas d'image rehaussée de {} : lancez « Rehausser ».</translation>
  </message>
  <message>
   <source>Reading {}...</source>
   <translation>Lecture de {}...</translation>
  </message>
  <message>
   <source>{} The enhanced image is shown.</source>
   <translation>{} L'image rehaussée est montrée.</translation>
  </message>
  <message>
   <source>predicted to {:.1f} px</source>
   <translation>prédit à {:.1f} px près</translation>
  </message>
  <message>
   <source>mark {:.1f} px off</source>
   <translation>pointé à {:.1f} px</translation>
  </message>
  <message>
   <source>{} cannot be shown: {}.</source>
   <translation>{} ne peut pas être montré : {}.</translation>
  </message>
  <message>
   <source>not found</source>
   <translation>introuvable</translation>
  </message>
  <message>
   <source>{} cannot be shown: it holds {} x {} pixels, the survey says {} x {}.</source>
   <translation>{} ne peut pas être montré : il contient {} x {} pixels, le levé indique {} x {}.</translation>
  </message>
  <message>
   <source>damaged</source>
   <translation>endommagé</translation>
  </message>
  <message>
   <source>it is all one value</source>
   <translation>tout y a la même valeur</translation>
  </message>
  <message>
   <source>Point, photograph</source>
   <translation>Point, photographie</translation>
  </message>
  <message>
   <source>Off</source>
   <translation>Écart</translation>
  </message>
  <message>
   <source>Of a point: in how many photographs it is marked. Of a photograph: how it was marked.</source>
   <translation>D'un point : dans combien de photographies il est pointé. D'une photographie : comment elle a été pointée.</translation>
  </message>
  <message>
   <source>Of a point: its residual in plan and height. Of a mark: from where it should be.</source>
   <translation>D'un point : son résidu en plan et en hauteur. D'un pointé : son écart à la prédiction.</translation>
  </message>
  <message>
   <source>by eye</source>
   <translation>à l'œil</translation>
  </message>
  <message>
   <source>score {:.2f}</source>
   <translation>score {:.2f}</translation>
  </message>
  <message>
   <source>skipped</source>
   <translation>passée</translation>
  </message>
  <message>
   <source>It took no part in the adjustment: two marks are needed.</source>
   <translation>Il n'a pas participé à la compensation : il faut deux pointés.</translation>
  </message>
  <message>
   <source>{}: {:+.3f} m east, {:+.3f} m north, {:+.3f} m up</source>
   <translation>{} : {:+.3f} m est, {:+.3f} m nord, {:+.3f} m haut</translation>
  </message>
  <message>
   <source>as was to be expected</source>
   <translation>comme il fallait s'y attendre</translation>
  </message>
  <message>
   <source>larger than expected</source>
   <translation>plus grand qu'attendu</translation>
  </message>
  <message>
   <source>much too large</source>
   <translation>beaucoup trop grand</translation>
  </message>
  <message>
   <source>The layers cannot be written to {}: {}.</source>
   <translation>Les couches ne peuvent pas être écrites dans {} : {}.</translation>
  </message>
  <message>
   <source>Survey {}</source>
   <translation>Levé {}</translation>
  </message>
  <message>
   <source>Residuals, {} times enlarged</source>
   <translation>Résidus, agrandis {} fois</translation>
  </message>
  <message>
   <source>Surface</source>
   <translation>Surface</translation>
  </message>
  <message>
   <source>Hillshade</source>
   <translation>Ombrage</translation>
  </message>
 </context>
</TS>
